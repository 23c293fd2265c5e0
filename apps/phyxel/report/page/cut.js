// A plane that cuts the bodies open, and the faces that it shows: where the plane is inside of a surface, by the stencil buffer.
// normal: of length 1, or null without a cut; at: the place along it, in units of the radius about the centre; middle: of the
// places that the slider reaches.
const cutting = {normal: null, at: 0, middle: 0, side: 1, faces: true}, uncut = [0, 0, 0, 1];

/// The plane in a frame: normal and offset, in units of the radius about the centre; what lies beyond it is cut away.
function cutPlane(frame) {
  if (!cutting.normal) return uncut;
  const follow = data.follow ? dot3(data.follow[frame], cutting.normal) : 0;
  return [...cutting.normal.map(x => cutting.side * x), cutting.side * (cutting.at + follow)];
}

/// Discards what is cut away, in a fragment shader that has `around`.
const cutAway = `
uniform vec4 cut;
bool isCut(vec3 place) { return dot(place, cut.xyz) > cut.w; }`;

/// A square in the plane that holds all faces, of half a width in units of the radius, and the texture of values on it.
const face = {half: 1.1, texels: 256, unit: 4, key: null, texture: null, corners: null, plain: true};

/// The fragment shader of faces.
const faceColour = `
centroid in vec3 around; uniform vec3 towards, across, upward, heart, facing; uniform sampler2D values; uniform float plainFace, halfFace; out vec4 colour;
void main() {
  vec2 at = vec2(dot(around - heart, across), dot(around - heart, upward)) / (2.0 * halfFace) + 0.5;
  vec3 base = plainFace > 0.0 ? vec3(0.82, 0.8, 0.76) : baseColour(shareOf(texture(values, at).r));
  colour = vec4(base * (0.72 + 0.3 * max(0.0, dot(facing, towards))), 1.0);
}`;

/// Values of the phyxels around a plane on a grid of places in it: means with the weights of carriers. Bodies are not mixed.
function faceValues(frame, plane, across, upward, heart) {
  const n = face.texels, sums = new Float32Array(n * n), weights = new Float32Array(n * n), bodiesShown = shown.field < 0;
  const texel = 2 * face.half / n, usual = data.reach;
  const splat = (reach, isFree) => {
    for (let i = 0; i < data.phyxels; ++i) {
      const p = source.phyxelAt(frame, i);
      const away = plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3];
      if (Math.abs(away) >= reach) continue;
      const along = axis => axis[0] * (p[0] - heart[0]) + axis[1] * (p[1] - heart[1]) + axis[2] * (p[2] - heart[2]);
      const u = (along(across) + face.half) / texel - 0.5, v = (along(upward) + face.half) / texel - 0.5;
      const wide = Math.sqrt(reach * reach - away * away) / texel, value = source.valueAt(frame, i);
      for (let y = Math.max(0, Math.ceil(v - wide)); y <= Math.min(n - 1, v + wide); ++y) {
        for (let x = Math.max(0, Math.ceil(u - wide)); x <= Math.min(n - 1, u + wide); ++x) {
          const k = y * n + x;
          if (isFree && !isFree[k]) continue;
          const q2 = ((x - u) ** 2 + (y - v) ** 2) * texel * texel / (reach * reach) + away * away / (reach * reach);
          const w = Math.max(1e-3, 1 - q2) ** 3;
          if (!bodiesShown) { sums[k] += w * value; weights[k] += w; }
          else if (w > weights[k]) { weights[k] = w; sums[k] = w * value; }
        }
      }
    }
  };
  splat(usual);
  // Where a body is stretched, the phyxels are farther apart.
  splat(2.5 * usual, Uint8Array.from(weights, w => w === 0 ? 1 : 0));
  for (let k = 0; k < sums.length; ++k) sums[k] = weights[k] > 0 ? sums[k] / weights[k] : 0;
  return sums;
}

/// Two directions along a plane, and its place nearest to the middle of what is seen.
function frameOfPlane(plane) {
  const normal = plane.slice(0, 3), least = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs)));
  const unit = v => v.map(x => x / Math.hypot(...v)), from = about(), off = plane[3] - dot3(normal, from);
  const across = unit(cross3([0, 1, 2].map(k => k === least ? 1 : 0), normal));
  return {across, upward: cross3(normal, across), heart: from.map((x, k) => x + off * normal[k])};
}

/// Makes the buffer of a square in the plane and the texture of its values, if they are not those of the last frame.
function prepareFace(frame, plane) {
  face.half = 1.1 * (source.farther?.() ?? 1);
  const key = `${frame.number} ${shown.field} ${plane} ${face.half}`;
  const {across, upward, heart} = frameOfPlane(plane);
  if (face.key === key) return {across, upward, heart};
  face.texture ??= gl.createTexture();
  face.corners ??= gl.createBuffer();
  const corner = (a, b) => heart.map((h, k) => h + face.half * (a * across[k] + b * upward[k]));
  gl.bindBuffer(gl.ARRAY_BUFFER, face.corners);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([corner(-1, -1), corner(1, -1), corner(-1, 1), corner(1, 1)].flat()), gl.DYNAMIC_DRAW);
  face.plain = !frame.phyxels;
  const values = face.plain ? new Float32Array(face.texels ** 2) : faceValues(frame, plane, across, upward, heart);
  gl.activeTexture(gl.TEXTURE0 + face.unit);
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
  gl.uniform1f(at.halfFace, face.half);
  gl.uniform1i(at.values, face.unit);
  gl.disableVertexAttribArray(1);
  gl.disableVertexAttribArray(2);
  gl.bindBuffer(gl.ARRAY_BUFFER, face.corners);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  gl.disable(gl.STENCIL_TEST);
}

// --- controls ------------------------------------------------------------------------------------
/// The middle of what is seen, along a direction, where it is not followed anyway.
const middleAlong = normal => data.follow ? 0 : dot3(normal, about());

/// Cuts across a direction, or no longer (null); the side of the view is cut away.
/// place: along it, in units of the radius about the centre
function cutAcross(normal, place) {
  const [slider, flip, shownPlace] = ['cut-at', 'cut-flip', 'cut-place'].map(id => document.getElementById(id));
  for (const part of [slider, flip, shownPlace]) part.hidden = !normal;
  cutting.normal = normal && normal.map(x => x / Math.hypot(...normal));
  if (!normal) return;
  cutting.middle = middleAlong(cutting.normal);
  const width = widthAlong(cutting.normal), end = 0.501 * width;
  cutting.at = Math.min(cutting.middle + end, Math.max(cutting.middle - end, place));
  cutting.side = dot3(matrix(view)[2], cutting.normal) < 0 ? -1 : 1;
  slider.value = 500 + 1000 * (cutting.at - cutting.middle) / width;
  sayPlace();
}
/// The width of the box of all frames, along a direction.
const widthAlong = normal => sides.reduce((sum, side, k) => sum + Math.abs(normal[k]) * side, 0) * (source.farther?.() ?? 1);

function sayPlace() {
  const place = dot3(data.centre, cutting.normal) + data.radius * cutting.at, axis = cutting.normal.findIndex(x => x === 1);
  const along = axis < 0 ? ` along (${cutting.normal.map(x => x.toFixed(2)).join(', ')})` : '';
  document.getElementById('cut-place').textContent = `${short(+place.toPrecision(3))} m${along}`;
}

/// The direction that a name stands for: x, y, z, the present view, or three numbers; null for others.
function directionCalled(name) {
  const axis = 'xyz'.indexOf(name), numbers = name.split(',').map(Number);
  if (name.length === 1 && axis >= 0) return [0, 1, 2].map(k => k === axis ? 1 : 0);
  if (name === 'view') return [...matrix(view)[2]];
  return numbers.length === 3 && numbers.every(Number.isFinite) && Math.hypot(...numbers) > 0 ? numbers : null;
}

function controlCut() {
  const choice = document.getElementById('cut'), slider = document.getElementById('cut-at');
  for (const [value, text] of [['', 'nothing'], ['x', 'across x'], ['y', 'across y'], ['z', 'across z'], ['view', 'across the view']]) choice.append(element('option', {value}, text));
  choice.addEventListener('change', () => {
    const normal = directionCalled(choice.value);
    cutAcross(normal, normal && middleAlong(normal));
    draw();
  });
  slider.addEventListener('input', () => {
    cutting.at = cutting.middle + (slider.value / 1000 - 0.5) * widthAlong(cutting.normal);
    sayPlace();
    draw();
  });
  document.getElementById('cut-flip').addEventListener('click', () => { cutting.side = -cutting.side; draw(); });
  // #cut=y, #cut=y:0.1 or #cut=1,1,0:0.1, with the place in m along the direction
  const [name, place] = (asked.get('cut') ?? '').split(':'), normal = directionCalled(name);
  if (normal) {
    const size = Math.hypot(...normal);
    cutAcross(normal, place === undefined ? middleAlong(normal) / size : (Number(place) - dot3(data.centre, normal) / size) / data.radius);
    if (name.includes(',')) choice.append(element('option', {value: name}, `across (${name})`));
    choice.value = name;
  } else {
    cutAcross(null);
  }
}
