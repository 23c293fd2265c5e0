// A plane that cuts the bodies open, and the faces that it shows: where the plane is inside of a surface, by the stencil buffer.
const cutting = {axis: -1, at: 0, side: 1, faces: true}, uncut = [0, 0, 0, 1];

/// The plane in a frame: normal and offset, in units of the radius about the centre; what lies beyond it is cut away.
function cutPlane(frame) {
  if (cutting.axis < 0) return uncut;
  const normal = [0, 0, 0], follow = data.follow ? data.follow[frame][cutting.axis] : 0;
  normal[cutting.axis] = cutting.side;
  return [...normal, cutting.side * (cutting.at + follow)];
}

/// Discards what is cut away, in a fragment shader that has `around`.
const cutAway = `
uniform vec4 cut;
bool isCut(vec3 place) { return dot(place, cut.xyz) > cut.w; }`;

/// A square in the plane that holds all faces, of half a width in units of the radius, and the texture of values on it.
const face = {half: 1.1, texels: 256, key: null, texture: null, corners: null, plain: true};

/// The fragment shader of faces.
const faceColour = `
centroid in vec3 around; uniform vec3 towards, across, upward, heart, facing; uniform sampler2D values; uniform float plainFace; out vec4 colour;
void main() {
  vec2 at = vec2(dot(around - heart, across), dot(around - heart, upward)) / ${(2 * face.half).toFixed(2)} + 0.5;
  vec3 base = plainFace > 0.0 ? vec3(0.82, 0.8, 0.76) : baseColour(shareOf(texture(values, at).r));
  colour = vec4(base * (0.72 + 0.3 * max(0.0, dot(facing, towards))), 1.0);
}`;

/// Values of the phyxels around a plane on a grid of places in it: means with the weights of carriers. Bodies are not mixed.
function faceValues(frame, plane, across, upward, heart) {
  const n = face.texels, sums = new Float32Array(n * n), weights = new Float32Array(n * n), points = frame.phyxels.points;
  const bodiesShown = shown.field < 0, field = bodiesShown ? bodiesOf('phyxels') : frame.phyxels.fields[shown.field];
  const texel = 2 * face.half / n, usual = data.reach;
  const splat = (reach, isFree) => {
    for (let i = 0; 3 * i < points.length; ++i) {
      const p = [0, 1, 2].map(k => points[3 * i + k] * data.scale[k] + data.low[k]);
      const away = plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3];
      if (Math.abs(away) >= reach) continue;
      const along = axis => axis[0] * (p[0] - heart[0]) + axis[1] * (p[1] - heart[1]) + axis[2] * (p[2] - heart[2]);
      const u = (along(across) + face.half) / texel - 0.5, v = (along(upward) + face.half) / texel - 0.5;
      const wide = Math.sqrt(reach * reach - away * away) / texel;
      for (let y = Math.max(0, Math.ceil(v - wide)); y <= Math.min(n - 1, v + wide); ++y) {
        for (let x = Math.max(0, Math.ceil(u - wide)); x <= Math.min(n - 1, u + wide); ++x) {
          const k = y * n + x;
          if (isFree && !isFree[k]) continue;
          const q2 = ((x - u) ** 2 + (y - v) ** 2) * texel * texel / (reach * reach) + away * away / (reach * reach);
          const w = Math.max(1e-3, 1 - q2) ** 3;
          if (!bodiesShown) { sums[k] += w * field[i]; weights[k] += w; }
          else if (w > weights[k]) { weights[k] = w; sums[k] = w * field[i]; }
        }
      }
    }
  };
  splat(usual);
  // Where a body is stretched, the phyxels are farther apart.
  splat(2.5 * usual, Uint8Array.from(weights, w => w === 0 ? 1 : 0));
  for (let k = 0; k < sums.length; ++k) sums[k] = weights[k] > 0 ? sums[k] / weights[k] / 65535 : 0;
  return sums;
}

/// Two directions along an axis-parallel plane, and its place nearest to the centre.
function frameOfPlane(plane) {
  const axis = plane.slice(0, 3).findIndex(v => v !== 0), across = [0, 0, 0], upward = [0, 0, 0];
  across[(axis + 1) % 3] = 1; upward[(axis + 2) % 3] = 1;
  return {across, upward, heart: [0, 1, 2].map(k => plane[k] * plane[3])};
}

/// Makes the buffer of a square in the plane and the texture of its values, if they are not those of the last frame.
function prepareFace(frame, plane) {
  const key = `${frame.number} ${shown.field} ${plane}`;
  const {across, upward, heart} = frameOfPlane(plane);
  if (face.key === key) return {across, upward, heart};
  face.texture ??= gl.createTexture();
  face.corners ??= gl.createBuffer();
  const corner = (a, b) => heart.map((h, k) => h + face.half * (a * across[k] + b * upward[k]));
  gl.bindBuffer(gl.ARRAY_BUFFER, face.corners);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([corner(-1, -1), corner(1, -1), corner(-1, 1), corner(1, 1)].flat()), gl.DYNAMIC_DRAW);
  face.plain = !frame.phyxels;
  const values = face.plain ? new Float32Array(face.texels ** 2) : faceValues(frame, plane, across, upward, heart);
  gl.activeTexture(gl.TEXTURE2);
  gl.bindTexture(gl.TEXTURE_2D, face.texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16F, face.texels, face.texels, 0, gl.RED, gl.FLOAT, values);
  const filter = shown.field < 0 ? gl.NEAREST : gl.LINEAR;
  for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, which, filter);
  for (const which of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, which, gl.CLAMP_TO_EDGE);
  face.key = key;
  return {across, upward, heart};
}

/// Draws the faces of a cut surface. use: sets a program's uniforms; drawSurface: draws the surface by them; turned: turns a
/// direction into the view
function drawFaces(frame, use, drawSurface, turned) {
  const plane = cutPlane(frame.number);
  if (plane === uncut || !cutting.faces) return;
  const {across, upward, heart} = prepareFace(frame, plane);
  // Behind a place of the plane the surface has more back sides than front sides, or fewer, if the place is inside.
  gl.enable(gl.STENCIL_TEST);
  gl.colorMask(false, false, false, false);
  gl.depthMask(false);
  gl.disable(gl.DEPTH_TEST);
  gl.stencilFunc(gl.ALWAYS, 0, 255);
  gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
  gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
  drawSurface(use(programs.castingSurface));
  gl.enable(gl.DEPTH_TEST);
  gl.depthMask(true);
  gl.colorMask(true, true, true, true);
  gl.stencilFunc(gl.NOTEQUAL, 0, 255);
  gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
  const at = use(programs.face);
  gl.uniform3fv(at.scale, [1, 1, 1]);
  gl.uniform3fv(at.low, [0, 0, 0]);
  gl.uniform3fv(at.across, across);
  gl.uniform3fv(at.upward, upward);
  gl.uniform3fv(at.heart, heart);
  gl.uniform3fv(at.facing, turned(plane.slice(0, 3)));
  gl.uniform1f(at.plainFace, face.plain ? 1 : 0);
  gl.uniform1i(at.values, 2);
  gl.disableVertexAttribArray(1);
  gl.disableVertexAttribArray(2);
  gl.bindBuffer(gl.ARRAY_BUFFER, face.corners);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  gl.disable(gl.STENCIL_TEST);
}

// --- controls ------------------------------------------------------------------------------------
/// Cuts across an axis, or no longer; the side of the view is cut away. place: in units of the radius about the centre
function cutAcross(axis, place) {
  cutting.axis = axis;
  if (axis >= 0) {
    const end = 0.501 * sides[axis];
    cutting.at = Math.min(end, Math.max(-end, place));
    cutting.side = matrix(view)[2][axis] < 0 ? -1 : 1;
  }
  const [choice, slider, flip, shownPlace] = ['cut', 'cut-at', 'cut-flip', 'cut-place'].map(id => document.getElementById(id));
  choice.value = axis;
  for (const part of [slider, flip, shownPlace]) part.hidden = axis < 0;
  if (axis < 0) return;
  slider.value = 500 + 1000 * cutting.at / sides[axis];
  shownPlace.textContent = `${short(+(data.centre[axis] + data.radius * cutting.at).toPrecision(3))} m`;
}

function controlCut() {
  const choice = document.getElementById('cut'), slider = document.getElementById('cut-at');
  choice.append(element('option', {value: -1}, 'nothing'), ...['x', 'y', 'z'].map((name, k) => element('option', {value: k}, `across ${name}`)));
  choice.addEventListener('change', () => { cutAcross(Number(choice.value), 0); draw(); });
  slider.addEventListener('input', () => { const {side, axis} = cutting; cutAcross(axis, (slider.value / 1000 - 0.5) * sides[axis]); cutting.side = side; draw(); });
  document.getElementById('cut-flip').addEventListener('click', () => { cutting.side = -cutting.side; draw(); });
  const wanted = /^([xyz])(?::(.+))?$/.exec(asked.get('cut') ?? '');  // #cut=y:0.1
  const axis = wanted ? 'xyz'.indexOf(wanted[1]) : -1;
  cutAcross(axis, wanted?.[2] ? (Number(wanted[2]) - data.centre[axis]) / data.radius : 0);
}
