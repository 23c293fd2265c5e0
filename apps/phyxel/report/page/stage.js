// The stage of a page: bodies and obstacles, seen by a camera that the pointer turns. The page's `source` has the bodies: how
// shaders place them, the buffers that they read, and the colours.
const stage = document.getElementById('stage'), canvas = stage.querySelector('canvas');

/// Bytes of a frame, decoded when it is first shown; the last few are kept.
const kept = new Map();
function bytesOf(id) {
  if (kept.has(id)) return kept.get(id);
  const text = atob(document.getElementById(id).textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; ++k) bytes[k] = text.charCodeAt(k);
  kept.set(id, bytes.buffer);
  return bytes.buffer;
}
const triangles = data.surfels ? new Uint32Array(bytesOf('triangles')) : null;

/// The body of each point of a family.
function bodiesOf(family) {
  const id = `${family}-bodies`;
  return document.getElementById(id) ? new Uint16Array(bytesOf(id)) : new Uint16Array(data[family]);
}

// --- drawing -------------------------------------------------------------------------------------
const gl = canvas.getContext('webgl2', {antialias: true, stencil: true, preserveDrawingBuffer: true});
const view = {}, fromTheRight = [0.398, 0.697, 0.597];  // the light of a page without obstacles
const shown = {frame: 0, field: data.fields.length ? data.opening.field : -1, log: false, surface: data.surfels > 0, phyxels: data.surfels === 0, obstacles: obstacles.length > 0, range: 'bulk'};
let programs = null, cornerBuffer = null;

function compile(vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, '#version 300 es\nprecision highp float;\n' + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  ['point', 'field', 'normal', 'carriers', 'weights'].forEach((name, k) => gl.bindAttribLocation(program, k, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const at = {};
  for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++k) {
    const {name} = gl.getActiveUniform(program, k);
    at[name] = gl.getUniformLocation(program, name);
  }
  return {program, at};
}

/// The position of a field's value in the range of colours.
const rangeOfColours = `
uniform vec2 range; uniform float origin;  // origin: lowest value of a field over its width; negative for linear colours
float shareOf(float field) {
  return origin < 0.0 ? (field - range.x) / max(range.y - range.x, 1e-6)
                      : log(max(field + origin, 1e-7) / (range.x + origin)) / log((range.y + origin) / (range.x + origin));
}`;

/// A vertex shader's part that places a point. motion: moved(), its place in units of `scale`; turned(normal); shade(), its field.
const place = motion => motion + rangeOfColours + `
uniform vec3 scale, low, eye; uniform mat3 turn, pose; uniform vec4 lens; uniform float parallel;
out float value; out vec3 seen; centroid out vec3 around;  // within triangles, also at their edges
void put() {
  around = pose * (moved() * scale) + low;
  seen = turn * around - eye;  // looking along -z
  gl_Position = vec4(lens.x * seen.x, lens.y * seen.y, lens.z * seen.z + lens.w, mix(-seen.z, 1.0, parallel));  // parallel: of a light far away
  value = shareOf(shade());
}`;
/// Points that stay where they are.
const still = `
in vec3 point;
vec3 moved() { return point; }
vec3 turned(vec3 normal) { return normal; }
float shade() { return 0.0; }`;

function prepare() {
  const placeOfSurface = motion => place(motion) + `
in vec4 normal; out vec3 facing, upright;
void main() { put(); upright = pose * turned(normal.xyz); facing = turn * upright; }`;
  const surface = compile(placeOfSurface(source.surfaceMotion), ramp + shadows + cutAway + `
in float value; in vec3 seen, facing, upright; centroid in vec3 around; uniform vec3 towards; out vec4 colour;
void main() {
  if (isCut(around)) discard;
  vec3 n = normalize(facing), v = normalize(-seen), out_ = normalize(upright);
  if (dot(n, v) < 0.0) { n = -n; out_ = -out_; }
  vec3 base = baseColour(value);
  float open = lightAt(around, out_, 0.012);
  float light = 0.42 + 0.52 * open * max(0.0, dot(n, towards)) + 0.12 * max(0.0, dot(n, v)) + 0.14 * (1.0 - open) * (1.0 + dot(n, towards));
  float shine = 0.18 * open * pow(max(0.0, dot(reflect(-v, n), towards)), 24.0);
  colour = vec4(base * light + shine, 1.0);
}`);
  const placeOfBall = place(source.ballMotion) + `
uniform float ball;
void main() { put(); gl_PointSize = clamp(ball / gl_Position.w, 2.0, 200.0); }`;
  const round = `
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float rest = 1.0 - dot(p, p);
  if (rest < 0.0) discard;`;
  const balls = compile(placeOfBall, ramp + cutAway + `
in float value; in vec3 seen; centroid in vec3 around; uniform vec3 towards; out vec4 colour;
void main() {${round}
  if (isCut(around)) discard;
  vec3 n = vec3(p.x, -p.y, sqrt(rest));
  vec3 base = baseColour(value);
  colour = vec4(base * (0.4 + 0.6 * max(0.0, dot(n, towards))), 1.0);
}`);
  const castingSurface = compile(placeOfSurface(source.surfaceMotion), cutAway + `
centroid in vec3 around;
void main() { if (isCut(around)) discard; }`);
  const face = compile(place(still) + '\nvoid main() { put(); }', ramp + rangeOfColours + faceColour);
  programs = {surface, balls, castingSurface, face};
  if (obstacles.length) {
    programs.obstacle = compile(placeOfSurface(still), shadows + obstacleColour);
    programs.casting = compile(placeOfSurface(still), 'void main() {}');
    programs.castingBalls = compile(placeOfBall, `${cutAway}\ncentroid in vec3 around;\nvoid main() {${round}\n  if (isCut(around)) discard;\n}`);
    prepareScenery();
  }
  source.prepare();
  if (triangles) cornerBuffer = filled(gl.ELEMENT_ARRAY_BUFFER, triangles);
}

/// A buffer with the numbers of an array.
function filled(kind, array) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(kind, buffer);
  gl.bufferData(kind, array, gl.STATIC_DRAW);
  return buffer;
}

/// Sets the buffer of an attribute.
function attribute(k, buffer, size, type, normalised) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(k);
  gl.vertexAttribPointer(k, size, type, normalised, 0, 0);
}

const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross3 = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/// A vector along the rows of a matrix.
function turnedBy(rows, v) { return rows.map(row => dot3(row, v)); }

/// Of a lens whose field of view is along the shorter side of the stage.
const focal = aspect => Math.min(1, aspect) / Math.tan(data.view.field_of_view * Math.PI / 360);

/// The outermost points about the point around which the view turns, along the axes of the first view: right, up, backwards.
const outermost = data.outermost.map(p => turnedBy(matrix(data.view), p.map((v, k) => v - data.view.pivot[k])));
const middle = [0, 1].map(axis => {
  const all = outermost.map(p => p[axis]);
  return data.view.centred ? 0 : (Math.min(...all) + Math.max(...all)) / 2;
});
/// The distance from which some points are seen. points: right, up, backwards
const distanceToSee = (points, aspect) => Math.max(...points.map(([x, y, z]) => z + 1.06 * focal(aspect) * Math.max(Math.abs(x - middle[0]) / aspect, Math.abs(y - middle[1]))));
/// The distance of the first view: the scene's, or that from which all of them are seen.
function firstDistance(aspect) { return data.view.distance ?? distanceToSee(outermost, aspect); }

/// Rows: right, up, backwards. Yaw and pitch are about data.axes, the last of which is up.
function matrix(from) {
  const [cy, sy, cp, sp] = [Math.cos(from.yaw), Math.sin(from.yaw), Math.cos(from.pitch), Math.sin(from.pitch)];
  const rows = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
  return rows.map(row => [0, 1, 2].map(k => row[0] * data.axes[0][k] + row[1] * data.axes[1][k] + row[2] * data.axes[2][k]));
}

/// How far what a page follows has come, in units of the radius.
function about() { return source.about?.() ?? [0, 0, 0]; }
/// The point around which the view turns.
function pivot() { return about().map((x, k) => x + data.view.pivot[k]); }
/// From how far it is seen.
function distanceFor(aspect) { return view.distance * firstDistance(aspect) * (source.farther?.() ?? 1); }
/// The eye in the camera's directions.
function eyeOf(rows, aspect) {
  const before = turnedBy(rows, pivot());
  return [before[0] + view.shift[0], before[1] + view.shift[1], before[2] + distanceFor(aspect)];
}

function startView() { Object.assign(view, {...data.view, distance: 1, shift: [...middle]}); }

function draw() {
  const frame = source.frame();
  if (!frame) return;  // none has come yet
  stage.querySelector('.clock').textContent = source.clock(frame);
  // Colours span low to high, in units of the field; shaders are given its shares of from to to.
  const {low, high, logarithmic, from, to} = source.span(frame), field = data.fields[shown.field];
  drawLegend(low, high, logarithmic, from, to);
  if (!gl) return;
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  source.upload(frame);
  gl.enable(gl.DEPTH_TEST);
  const aspect = width / height, distance = distanceFor(aspect), lens = focal(aspect);
  const scene = shown.obstacles, reach = 2.5 + Math.hypot(...pivot());
  const near = scene ? 0.02 * distance : Math.max(0.01, distance - reach), far = distance + (scene ? fade[1] + reach : reach);
  const rows = matrix(view), turn = columns(rows.flat());
  const spread = field ? Math.max(to - from, 1e-300) : 1;
  const eye = {turn, eye: eyeOf(rows, aspect), lens: [lens / aspect, lens, -(far + near) / (far - near), -2 * far * near / (far - near), 0]};
  const use = (seenFrom, {program, at}) => {
    gl.useProgram(program);
    gl.uniformMatrix3fv(at.pose, false, [1, 0, 0, 0, 1, 0, 0, 0, 1]);
    gl.uniform3fv(at.scale, source.scale);
    gl.uniform3fv(at.low, source.low);
    gl.uniform3fv(at.about, about());
    gl.uniformMatrix3fv(at.turn, false, seenFrom.turn);
    gl.uniform3fv(at.eye, seenFrom.eye);
    gl.uniform4fv(at.lens, seenFrom.lens.slice(0, 4));
    gl.uniform1f(at.bodies, field ? 0 : 1);
    gl.uniform1f(at.origin, logarithmic ? from / spread : -1);
    gl.uniform1f(at.parallel, seenFrom.lens[4]);
    gl.uniform4fv(at.cut, cutPlane(frame.number));
    gl.uniform2f(at.range, field ? (low - from) / spread : 0, field ? (high - from) / spread : 1);
    gl.uniform3fv(at.towards, scene ? turnedBy(rows, light.towards) : fromTheRight);
    return at;
  };
  const drawSurface = at => {
    source.bindSurface(at);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, cornerBuffer);
    gl.drawElements(gl.TRIANGLES, source.corners?.(frame) ?? triangles.length, gl.UNSIGNED_INT, 0);
  };
  const drawBalls = (at, size, some) => {
    gl.disableVertexAttribArray(2);
    gl.uniform1f(at.ball, size);
    source.bindBalls(at);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, some?.buffer ?? null);
    if (some) gl.drawElements(gl.POINTS, some.count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.POINTS, 0, data.phyxels);
  };
  const surface = shown.surface && frame.surfels, balls = shown.phyxels && frame.phyxels;
  if (scene) {
    const lightEye = {turn: columns(light.rows.flat()), eye: light.rows.map(row => dot3(row, about())), lens: [1 / lit, 1 / lit, -1 / lightDepth, 0, 1]};
    drawShadows(frame.number, program => use(lightEye, program), () => {
      if (surface) drawSurface(use(lightEye, programs.castingSurface));
      else if (balls) drawBalls(use(lightEye, programs.castingBalls), data.spacing * 0.7 * texels / 2 / lit);
    });
  }
  gl.viewport(0, 0, width, height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  if (surface) {
    const at = use(eye, programs.surface);
    bindShadows(at, scene);
    drawSurface(at);
    drawFaces(frame, program => use(eye, program), drawSurface, v => turnedBy(rows, v));
  }
  const torn = source.torn?.(frame);
  if (surface && torn?.count) drawBalls(use(eye, programs.balls), data.spacing * 0.84 * lens * height / 2, torn);
  if (balls) {
    const at = use(eye, programs.balls);
    drawBalls(at, data.spacing * 0.7 * lens * height / 2 * (shown.surface ? 0.5 : 1));
  }
  if (scene) drawObstacles(frame.number, program => { const at = use(eye, program); bindShadows(at, true); return at; });
  drawAxes(rows);
}

// --- controls of both pages ----------------------------------------------------------------------
/// Fills the list of fields, and lets boxes choose what is drawn.
function controlShown() {
  const field = document.getElementById('field');
  field.append(element('option', {value: -1}, 'bodies'), ...data.fields.map((f, k) => element('option', {value: k}, f.name)));
  field.value = shown.field;
  for (const [name, count] of [['surface', data.surfels], ['phyxels', data.phyxels], ['obstacles', obstacles.length]]) {
    const box = document.getElementById(name);
    box.checked = shown[name]; box.disabled = !count;
    box.addEventListener('change', () => { shown[name] = box.checked; draw(); });
  }
  document.getElementById('with-obstacles').hidden = !obstacles.length;
  if (data.only_floor) document.querySelector('#with-obstacles span').textContent = 'floor';
}

// --- pointers ------------------------------------------------------------------------------------
/// Lets pointers turn, shift and enlarge what is seen, unless the page takes them (`source.takes`).
function watchPointers() {
  const pointers = new Map();
  canvas.addEventListener('pointerdown', event => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
  });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, event => pointers.delete(event.pointerId));
  canvas.addEventListener('pointermove', event => {
    const before = pointers.get(event.pointerId);
    if (!before || source.takes?.(event)) return;
    const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY, size = canvas.clientHeight;
    if (pointers.size === 2) {
      const other = [...pointers.values()].find(p => p.pointerId !== event.pointerId);
      const apart = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
      zoom(apart(before) / apart(event));
    } else if (event.shiftKey || event.buttons & 6) {
      view.shift[0] -= 2.2 * view.distance * dx / size; view.shift[1] += 2.2 * view.distance * dy / size;
    } else {
      view.yaw -= 3 * dx / size; view.pitch = Math.min(1.57, Math.max(-1.57, view.pitch + 3 * dy / size));
    }
    pointers.set(event.pointerId, event);
    draw();
  });
  const zoom = by => { view.distance = Math.min(8, Math.max(0.05, view.distance * by)); };
  canvas.addEventListener('wheel', event => { event.preventDefault(); zoom(Math.exp(event.deltaY / 700)); draw(); }, {passive: false});
  document.getElementById('reset').addEventListener('click', () => { startView(); draw(); });
  new ResizeObserver(draw).observe(canvas);
}

function pixelsOfStage() {
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return pixels;
}

/// The share of the stage that faces of a cut take.
function facesShare() {
  if (!cutting.normal) return 0;
  const full = pixelsOfStage();
  cutting.faces = false;
  draw();
  const hollow = pixelsOfStage();
  cutting.faces = true;
  draw();
  let count = 0;
  for (let k = 0; k < full.length; k += 4) if ([0, 1, 2, 3].some(c => full[k + c] !== hollow[k + c])) ++count;
  return count / (canvas.width * canvas.height);
}

/// For whoever tests the page: how much of the stage is drawn on, and what went wrong.
function tell(state) {
  document.body.dataset.state = state;
  if (!gl) return;
  const pixels = pixelsOfStage();
  let drawn = 0;
  for (let k = 3; k < pixels.length; k += 4) if (pixels[k]) ++drawn;
  document.body.dataset.drawn = (drawn / (canvas.width * canvas.height)).toFixed(4);
  document.body.dataset.frame = shown.frame;
  document.body.dataset.obstacles = scenery.parts.length;
  document.body.dataset.faces = facesShare().toFixed(4);
  document.body.dataset.error = gl.getError();
}
