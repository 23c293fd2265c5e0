// The obstacles of a trajectory, and the shadows of bodies and obstacles on each other. A page without obstacles has neither.
const obstacles = data.obstacles;

// --- shapes --------------------------------------------------------------------------------------
/// A surface of revolution about z. profile: corners [r, z, normal along r, normal along z]; pairs of them bound a band.
function revolved(profile) {
  const count = 64, points = [], normals = [], corners = [];
  for (const [r, z, nr, nz] of profile) {
    for (let i = 0; i < count; ++i) {
      const c = Math.cos(2 * Math.PI * i / count), s = Math.sin(2 * Math.PI * i / count);
      points.push(r * c, r * s, z); normals.push(nr * c, nr * s, nz);
    }
  }
  for (let k = 0; k + 1 < profile.length; k += 2) {
    for (let i = 0; i < count; ++i) {
      const a = k * count + i, b = k * count + (i + 1) % count;
      corners.push(a, b, b + count, a, b + count, a + count);
    }
  }
  return {points, normals, corners, lines: []};
}

/// The profile of a quarter of a circle between two angles from z, about a height.
function arc(radius, height, from, to) {
  const profile = [], bands = 16;
  const at = k => { const a = from + (to - from) * k / bands; return [radius * Math.sin(a), height + radius * Math.cos(a), Math.sin(a), Math.cos(a)]; };
  for (let k = 0; k < bands; ++k) profile.push(at(k), at(k + 1));
  return profile;
}

const shapes = {
  plane: () => ({points: [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0], normals: [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1], corners: [0, 1, 2, 0, 2, 3], lines: []}),
  sphere: ([radius]) => revolved([...arc(radius, 0, 0, Math.PI / 2), ...arc(radius, 0, Math.PI / 2, Math.PI)]),
  capsule: ([radius, length]) => revolved([...arc(radius, length / 2, 0, Math.PI / 2), [radius, length / 2, 1, 0], [radius, -length / 2, 1, 0],
                                           ...arc(radius, -length / 2, Math.PI / 2, Math.PI)]),
  cylinder: ([radius, length]) => revolved([[0, length / 2, 0, 1], [radius, length / 2, 0, 1], [radius, length / 2, 1, 0], [radius, -length / 2, 1, 0],
                                            [radius, -length / 2, 0, -1], [0, -length / 2, 0, -1]]),
  box: size => {
    const made = {points: [], normals: [], corners: [], lines: []};
    for (let axis = 0; axis < 3; ++axis) {
      for (const side of [-1, 1]) {
        const first = made.points.length / 3, u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const p = [0, 0, 0], n = [0, 0, 0];
          p[axis] = side * size[axis] / 2; p[u] = a * size[u] / 2; p[v] = b * size[v] / 2; n[axis] = side;
          made.points.push(...p); made.normals.push(...n);
        }
        made.corners.push(...[0, 1, 2, 0, 2, 3].map(k => first + k));
        if (axis !== 1) for (let k = 0; k < 4; ++k) made.lines.push(first + k, first + (k + 1) % 4);
      }
    }
    return made;
  },
};

/// The surface of obstacle k from a mesh. Normals are means over the triangles at a vertex that make a small angle.
function meshOf(k) {
  const p = new Float32Array(bytesOf(`obstacle${k}`)), t = new Uint32Array(bytesOf(`obstacle${k}-triangles`));
  const faces = [], around = Array.from({length: p.length / 3}, () => []);
  for (let f = 0; 3 * f < t.length; ++f) {
    const at = (corner, c) => p[3 * t[3 * f + corner] + c];
    const side = corner => [0, 1, 2].map(c => at(corner, c) - at(0, c));
    const [u, v] = [side(1), side(2)], n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.hypot(...n) || 1;
    faces.push({n: n.map(x => x / size), size});
    for (let corner = 0; corner < 3; ++corner) around[t[3 * f + corner]].push(f);
  }
  const made = {points: new Float32Array(3 * t.length), normals: new Float32Array(3 * t.length), corners: Uint32Array.from(t, (_, i) => i), lines: []};
  t.forEach((vertex, i) => {
    const own = faces[Math.floor(i / 3)].n, sum = [0, 0, 0];
    for (const f of around[vertex]) {
      const {n, size} = faces[f];
      if (n[0] * own[0] + n[1] * own[1] + n[2] * own[2] > 0.75) for (let c = 0; c < 3; ++c) sum[c] += size * n[c];
    }
    for (let c = 0; c < 3; ++c) { made.points[3 * i + c] = p[3 * vertex + c]; made.normals[3 * i + c] = sum[c]; }
  });
  return made;
}

// --- places --------------------------------------------------------------------------------------
/// Obstacles vanish between two distances from the middle, so that a floor has no horizon.
const sides = data.scale.map(s => 65535 * s), fade = [1.2, 4].map(times => times * Math.max(...sides));

/// The rotation, row by row, and the translation of an obstacle in a frame. Planes are squares beside the bodies.
function placeOf(obstacle, frame) {
  const place = obstacle.places[Math.min(frame, obstacle.places.length - 1)];
  const turn = place.slice(0, 9), at = place.slice(9);
  if (obstacle.shape !== 'plane') return {turn, at};
  const normal = [turn[2], turn[5], turn[8]], middle = about(), height = dot3(normal, at) - dot3(normal, middle);
  return {turn: turn.map(x => fade[1] * x), at: normal.map((x, k) => middle[k] + height * x)};
}

/// The columns of a matrix that is given row by row, as WebGL takes them.
function columns(m) { return [0, 3, 6, 1, 4, 7, 2, 5, 8].map(k => m[k]); }

// --- light ---------------------------------------------------------------------------------------
/// The light: from above, left of the first view and before it, as in the pictures of `phyxel render`. It rests while the view turns.
const light = (() => {
  const unit = v => { const size = Math.hypot(...v) || 1; return v.map(x => x / size); };
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const up = data.axes[2], {yaw} = data.view;
  const level = [0, 1, 2].map(k => Math.cos(yaw) * data.axes[0][k] + Math.sin(yaw) * data.axes[1][k]);
  const right = cross(up, level);
  const towards = unit(up.map((x, k) => x - 0.42 * right[k] + 0.24 * level[k]));
  const across = unit(cross(level, towards));
  return {towards, rows: [across, cross(towards, across), towards]};
})();

/// The light sees what is within this distance of the middle; bodies are within 1.
const lit = obstacles.some(o => o.shape !== 'plane' && !o.hollow) ? 1.6 : 1.05, lightDepth = 8, texels = 2048;

/// The share of the light that reaches a place: percentage-closer soft shadows (Fernando 2005), as in `phyxel render`.
const shadows = !obstacles.length ? 'uniform vec3 about; float lightAt(vec3 place, vec3 normal, float clear) { return 1.0; }' : `
uniform highp sampler2DShadow shade; uniform highp sampler2D depths; uniform mat3 lightRows; uniform float shaded; uniform vec3 about;
vec2 spread(int k, int n, float start) {
  float angle = 2.39996323 * float(k) + start, r = sqrt((float(k) + 0.5) / float(n));
  return r * vec2(cos(angle), sin(angle));
}
float lightAt(vec3 place, vec3 normal, float clear) {
  if (shaded == 0.0) return 1.0;
  vec3 p = lightRows * (place - about + clear * normal);
  vec3 at = vec3(p.xy / ${lit.toFixed(3)}, -p.z / ${lightDepth.toFixed(1)}) * 0.5 + 0.5;
  vec2 edge = abs(at.xy - 0.5);
  float inside = 1.0 - smoothstep(0.47, 0.5, max(edge.x, edge.y));
  if (inside == 0.0) return 1.0;
  at.z -= 0.001 * clear / 0.01;
  float start = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float wide = 0.03, found = 0.0, sum = 0.0;
  for (int k = 0; k < 12; ++k) {
    float depth = texture(depths, at.xy + wide * spread(k, 12, start)).r;
    if (depth < at.z) { sum += depth; found += 1.0; }
  }
  if (found == 0.0) return 1.0;
  float behind = (at.z - sum / found) * 2.0 * ${lightDepth.toFixed(1)};
  wide = clamp(0.06 * behind / (2.0 * ${lit.toFixed(3)}), 0.0008, 0.03);
  float open = 0.0;
  for (int k = 0; k < 24; ++k) open += texture(shade, vec3(at.xy + wide * spread(k, 24, start), at.z));
  return mix(1.0, open / 24.0, inside);
}`;

// --- drawing -------------------------------------------------------------------------------------
const scenery = {map: null, parts: []};

/// A texture for what the light sees, and buffers of the obstacles' surfaces.
function prepareScenery() {
  const texture = gl.createTexture(), frame = gl.createFramebuffer();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, texels, texels);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
  gl.drawBuffers([gl.NONE]);
  gl.readBuffer(gl.NONE);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  const samplers = [gl.LINEAR, gl.NEAREST].map(filter => {
    const sampler = gl.createSampler();
    for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.samplerParameteri(sampler, which, filter);
    for (const which of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.samplerParameteri(sampler, which, gl.CLAMP_TO_EDGE);
    return sampler;
  });
  gl.samplerParameteri(samplers[0], gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  gl.samplerParameteri(samplers[0], gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
  scenery.map = {texture, frame, samplers};
  const kept = (kind, array) => { const buffer = gl.createBuffer(); gl.bindBuffer(kind, buffer); gl.bufferData(kind, array, gl.STATIC_DRAW); return buffer; };
  scenery.parts = obstacles.map((obstacle, k) => {
    const {points, normals, corners, lines} = obstacle.shape === 'mesh' ? meshOf(k) : shapes[obstacle.shape](obstacle.lengths);
    return {obstacle, points: kept(gl.ARRAY_BUFFER, new Float32Array(points)), normals: kept(gl.ARRAY_BUFFER, new Float32Array(normals)),
            corners: kept(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners)), lines: kept(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(lines)),
            count: corners.length, ends: lines.length};
  });
}

/// Binds what the light sees to the two units that a program reads. shaded: false for a program that is to ignore it.
function bindShadows(at, shaded) {
  if (!scenery.map) return;
  gl.uniform1f(at.shaded, shaded ? 1 : 0);
  gl.uniform1i(at.shade, 0);
  gl.uniform1i(at.depths, 1);
  gl.uniformMatrix3fv(at.lightRows, false, columns(light.rows.flat()));
  for (const unit of [0, 1]) {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, scenery.map.texture);
    gl.bindSampler(unit, scenery.map.samplers[unit]);
  }
}

/// Draws what casts shadows, as the light sees it. bodies: draws the bodies.
function drawShadows(frame, use, bodies) {
  for (const unit of [0, 1]) { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_2D, null); }
  gl.bindFramebuffer(gl.FRAMEBUFFER, scenery.map.frame);
  gl.viewport(0, 0, texels, texels);
  gl.clear(gl.DEPTH_BUFFER_BIT);
  bodies();
  for (const part of scenery.parts) {
    if (!shown.obstacles || part.obstacle.hollow || part.obstacle.shape === 'plane') continue;
    drawPart(part, frame, use(programs.casting));
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
}

/// Draws the surface of an obstacle by a program that is in use. lines: its edges instead.
function drawPart(part, frame, at, lines = false) {
  const {turn, at: origin} = placeOf(part.obstacle, frame);
  gl.uniformMatrix3fv(at.pose, false, columns(turn));
  gl.uniform3fv(at.scale, [1, 1, 1]);
  gl.uniform3fv(at.low, origin);
  gl.uniform4fv(at.cut, uncut);
  gl.disableVertexAttribArray(1);
  for (const [k, buffer] of [[0, part.points], [2, part.normals]]) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(k);
    gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 0, 0);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, lines ? part.lines : part.corners);
  gl.drawElements(lines ? gl.LINES : gl.TRIANGLES, lines ? part.ends : part.count, gl.UNSIGNED_INT, 0);
}

/// Draws the obstacles over the bodies: first what hides, then what shows through.
function drawObstacles(frame, use) {
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const at = use(programs.obstacle);
  gl.uniform2fv(at.fade, fade);
  for (const ghosts of [false, true]) {
    gl.depthMask(!ghosts);
    for (const part of scenery.parts) {
      const plane = part.obstacle.shape === 'plane';
      gl.uniform3fv(at.plain, plane ? [0.86, 0.85, 0.83] : [0.68, 0.66, 0.63]);
      // A plane is seen from its front, what is hollow from within; the other side shows through.
      gl.uniform1f(at.ghost, plane ? -1 : part.obstacle.hollow ? 1 : 0);
      gl.uniform1f(at.pass, ghosts ? 1 : 0);
      if (!ghosts || plane || part.obstacle.hollow) drawPart(part, frame, at);
      if (ghosts && part.obstacle.hollow && part.ends) {
        gl.uniform1f(at.pass, 2);
        drawPart(part, frame, at, true);
      }
    }
  }
  gl.depthMask(true);
  gl.disable(gl.BLEND);
}

/// The fragment shader of obstacles.
const obstacleColour = `
in vec3 seen; in vec3 facing; centroid in vec3 around; in vec3 upright;
uniform vec3 plain, towards; uniform vec2 fade; uniform float ghost, pass; out vec4 colour;
void main() {
  vec3 n = normalize(facing), v = normalize(-seen);
  float side = dot(n, v) < 0.0 ? -1.0 : 1.0;
  bool through = ghost * side > 0.0;
  float opacity = 1.0 - smoothstep(fade.x, fade.y, length(around - about));
  if (pass == 2.0) { colour = vec4(0.3, 0.32, 0.36, 0.45 * opacity); return; }
  if (through != (pass == 1.0)) discard;
  if (through) opacity *= ghost < 0.0 ? 0.25 : 0.12;
  if (opacity < 0.01) discard;
  float open = through ? 1.0 : lightAt(around, side * normalize(upright), 0.01);
  float facingLight = max(0.0, side * dot(n, towards));
  colour = vec4(plain * (0.6 + 0.12 * max(0.0, side * dot(n, v)) + 0.36 * facingLight * open), opacity);
}`;
