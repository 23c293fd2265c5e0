// A trajectory: the moving body, its energies and momenta.
const stage = document.getElementById('stage'), canvas = stage.querySelector('canvas');
const frames = data.frames, steps = frames.length;

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
const frameKept = [];
function frameOf(k) {
  const found = frameKept.find(f => f.number === k);
  if (found) return found;
  const id = `frame${k}`, buffer = bytesOf(id);
  kept.delete(id);
  const frame = {number: k, surfels: null, phyxels: null};
  let at = 0;
  const take = (count, width) => { const a = new Uint16Array(buffer, at, count * width); at += 2 * count * width; return a; };
  for (const [family, count] of [['surfels', data.surfels], ['phyxels', data.phyxels]]) {
    if (count) frame[family] = {points: take(count, 3), fields: null};
  }
  const fields = data.fields.map(() => take(data.phyxels || data.surfels, 1));
  frame[data.phyxels ? 'phyxels' : 'surfels'].fields = fields;
  frameKept.push(frame);
  if (frameKept.length > 64) frameKept.shift();
  return frame;
}

const triangles = data.surfels ? new Uint32Array(bytesOf('triangles')) : null;
const carriers = data.surfels && data.phyxels ? new Uint32Array(bytesOf('carriers')) : null;
const weights = carriers ? new Uint8Array(bytesOf('weights')) : null;

/// A field of a frame's family; surfels have what the phyxels around them have.
function fieldOf(frame, family, number) {
  const own = frame[family].fields;
  if (own && own[number]) return own[number];
  const made = new Uint16Array(data.surfels), from = frame.phyxels.fields[number], each = data.carriers;
  for (let s = 0, k = 0; s < data.surfels; ++s) {
    let sum = 0;
    for (let c = 0; c < each; ++c, ++k) sum += weights[k] * from[carriers[k]];
    made[s] = sum / 255;
  }
  (frame[family].fields ??= [])[number] = made;
  return made;
}

/// The body of each point of a family.
function bodiesOf(family) {
  const id = `${family}-bodies`;
  return document.getElementById(id) ? new Uint16Array(bytesOf(id)) : new Uint16Array(data[family]);
}

/// Of the surface, area-weighted; in bytes for the GPU.
function normalsOf(points) {
  const n = new Float32Array(points.length), [sx, sy, sz] = data.scale;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = (points[b] - points[a]) * sx, uy = (points[b + 1] - points[a + 1]) * sy, uz = (points[b + 2] - points[a + 2]) * sz;
    const vx = (points[c] - points[a]) * sx, vy = (points[c + 1] - points[a + 1]) * sy, vz = (points[c + 2] - points[a + 2]) * sz;
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) { n[i] += x; n[i + 1] += y; n[i + 2] += z; }
  }
  const out = new Int8Array(4 * points.length / 3);
  for (let i = 0, o = 0; i < n.length; i += 3, o += 4) {
    const size = Math.hypot(n[i], n[i + 1], n[i + 2]) || 1;
    out[o] = 127 * n[i] / size; out[o + 1] = 127 * n[i + 1] / size; out[o + 2] = 127 * n[i + 2] / size;
  }
  return out;
}

// --- drawing -------------------------------------------------------------------------------------
const gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
const view = {}, fromTheRight = [0.398, 0.697, 0.597];  // the light of a page without obstacles
const shown = {frame: 0, field: data.fields.length ? data.opening.field : -1, log: false, surface: data.surfels > 0, phyxels: data.surfels === 0, obstacles: obstacles.length > 0, range: 'bulk'};
let programs = null, buffers = null;

function compile(vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, '#version 300 es\nprecision highp float;\n' + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  ['point', 'field', 'normal'].forEach((name, k) => gl.bindAttribLocation(program, k, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const at = {};
  for (const name of ['scale', 'low', 'turn', 'pose', 'eye', 'lens', 'range', 'origin', 'bodies', 'plain', 'ball', 'parallel', 'towards', 'fade', 'ghost', 'pass', 'shade', 'depths',
                      'lightRows', 'shaded']) at[name] = gl.getUniformLocation(program, name);
  return {program, at};
}

const place = `
in vec3 point; in float field;
uniform vec3 scale, low, eye; uniform mat3 turn, pose; uniform vec4 lens; uniform float parallel; uniform vec2 range; uniform float origin;  // origin: lowest value of a field over its width; negative for linear colours
out float value; out vec3 seen, around;
void put() {
  around = pose * (point * scale) + low;
  seen = turn * around - eye;  // looking along -z
  gl_Position = vec4(lens.x * seen.x, lens.y * seen.y, lens.z * seen.z + lens.w, mix(-seen.z, 1.0, parallel));  // parallel: of a light far away
  value = origin < 0.0 ? (field - range.x) / max(range.y - range.x, 1e-6)
                       : log(max(field + origin, 1e-7) / (range.x + origin)) / log((range.y + origin) / (range.x + origin));
}`;

function prepare() {
  const placeOfSurface = place + `
in vec4 normal; out vec3 facing, upright;
void main() { put(); upright = pose * normal.xyz; facing = turn * upright; }`;
  const surface = compile(placeOfSurface, ramp + shadows + `
in float value; in vec3 seen, facing, around, upright; uniform vec3 towards; out vec4 colour;
void main() {
  vec3 n = normalize(facing), v = normalize(-seen), out_ = normalize(upright);
  if (dot(n, v) < 0.0) { n = -n; out_ = -out_; }
  vec3 base = baseColour(value);
  float open = lightAt(around, out_, 0.012);
  float light = 0.42 + 0.52 * open * max(0.0, dot(n, towards)) + 0.12 * max(0.0, dot(n, v)) + 0.14 * (1.0 - open) * (1.0 + dot(n, towards));
  float shine = 0.18 * open * pow(max(0.0, dot(reflect(-v, n), towards)), 24.0);
  colour = vec4(base * light + shine, 1.0);
}`);
  const placeOfBall = place + `
uniform float ball;
void main() { put(); gl_PointSize = clamp(ball / gl_Position.w, 2.0, 200.0); }`;
  const round = `
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float rest = 1.0 - dot(p, p);
  if (rest < 0.0) discard;`;
  const balls = compile(placeOfBall, ramp + `
in float value; in vec3 seen; uniform vec3 towards; out vec4 colour;
void main() {${round}
  vec3 n = vec3(p.x, -p.y, sqrt(rest));
  vec3 base = baseColour(value);
  colour = vec4(base * (0.4 + 0.6 * max(0.0, dot(n, towards))), 1.0);
}`);
  programs = {surface, balls};
  if (obstacles.length) {
    programs.obstacle = compile(placeOfSurface, shadows + obstacleColour);
    programs.casting = compile(placeOfSurface, 'void main() {}');
    programs.castingBalls = compile(placeOfBall, `void main() {${round}\n}`);
    prepareScenery();
  }
  buffers = {surfels: [0, 1, 2].map(() => gl.createBuffer()), phyxels: [0, 1].map(() => gl.createBuffer()), triangles: gl.createBuffer()};
  if (triangles) {
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
  }
}

const focal = 1 / Math.tan(35 * Math.PI / 360);  // 35 degrees from bottom to top

/// The outermost points along the axes of the first view: right, up, backwards.
const outermost = data.outermost.map(p => matrix(data.view).map(row => row[0] * p[0] + row[1] * p[1] + row[2] * p[2]));
const middle = [0, 1].map(axis => {
  const all = outermost.map(p => p[axis]);
  return (Math.min(...all) + Math.max(...all)) / 2;
});
/// From how far all of them are seen in that view.
function distanceForAll(aspect) {
  return Math.max(...outermost.map(([x, y, z]) => z + 1.06 * focal * Math.max(Math.abs(x - middle[0]) / aspect, Math.abs(y - middle[1]))));
}

/// Rows: right, up, backwards. Yaw and pitch are about data.axes, the last of which is up.
function matrix(from) {
  const [cy, sy, cp, sp] = [Math.cos(from.yaw), Math.sin(from.yaw), Math.cos(from.pitch), Math.sin(from.pitch)];
  const rows = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
  return rows.map(row => [0, 1, 2].map(k => row[0] * data.axes[0][k] + row[1] * data.axes[1][k] + row[2] * data.axes[2][k]));
}

function startView() { Object.assign(view, {...data.view, distance: 1, shift: [...middle]}); }

let uploaded = null;
function upload(frame) {
  const key = `${frame.number} ${shown.field}`;
  if (uploaded === key) return;
  const fill = (buffer, array) => { gl.bindBuffer(gl.ARRAY_BUFFER, buffer); gl.bufferData(gl.ARRAY_BUFFER, array, gl.DYNAMIC_DRAW); };
  for (const family of ['surfels', 'phyxels']) {
    const f = frame[family];
    if (!f) continue;
    fill(buffers[family][0], f.points);
    fill(buffers[family][1], shown.field < 0 ? bodiesOf(family) : fieldOf(frame, family, shown.field));
  }
  if (frame.surfels) fill(buffers.surfels[2], frame.surfels.normals ??= normalsOf(frame.surfels.points));
  uploaded = key;
}

/// What the colours span, in units of the field: low, high, and whether by their logarithms.
function span(frame) {
  const field = data.fields[shown.field];
  if (!field) return [0, 1, false];
  const log = shown.log && field.decades[0] > 0;
  if (shown.range === 'bulk') return log ? [...field.decades, true] : [...field.bulk, false];
  let [low, high] = [field.low, field.high];
  if (shown.range === 'one') {
    const f = fieldOf(frame, frame.surfels && (shown.surface || !frame.phyxels) ? 'surfels' : 'phyxels', shown.field);
    let least = 65535, most = 0;
    for (const v of f) { if (v < least) least = v; if (v > most) most = v; }
    [low, high] = [least, most].map(v => field.low + v / 65535 * (field.high - field.low));
  }
  return log && high > 0 ? [Math.max(low, high / 1000), high, true] : [low, high, false];
}

function draw() {
  const frame = frameOf(shown.frame), time = frames[shown.frame];
  stage.querySelector('.clock').textContent = `t = ${time.toFixed(data.decimals)} s`;
  const [low, high, logarithmic] = span(frame), field = data.fields[shown.field];
  drawLegend(low, high, logarithmic);
  for (const chart of charts) chart.now(time);
  if (!gl) return;
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  upload(frame);
  gl.enable(gl.DEPTH_TEST);
  const aspect = width / height, distance = view.distance * distanceForAll(aspect);
  const scene = shown.obstacles;
  const near = scene ? 0.02 * distance : Math.max(0.01, distance - 2.5), far = distance + (scene ? fade[1] + 1 : 2.5);
  const rows = matrix(view), turn = columns(rows.flat());
  const spread = field ? Math.max(field.high - field.low, 1e-300) : 1;
  const eye = {turn, eye: [view.shift[0], view.shift[1], distance], lens: [focal / aspect, focal, -(far + near) / (far - near), -2 * far * near / (far - near), 0]};
  const use = (seenFrom, {program, at}) => {
    gl.useProgram(program);
    gl.uniformMatrix3fv(at.pose, false, [1, 0, 0, 0, 1, 0, 0, 0, 1]);
    gl.uniform3fv(at.scale, sides);
    gl.uniform3fv(at.low, data.low);
    gl.uniformMatrix3fv(at.turn, false, seenFrom.turn);
    gl.uniform3fv(at.eye, seenFrom.eye);
    gl.uniform4fv(at.lens, seenFrom.lens.slice(0, 4));
    gl.uniform1f(at.bodies, field ? 0 : 1);
    gl.uniform1f(at.origin, logarithmic ? field.low / spread : -1);
    gl.uniform1f(at.parallel, seenFrom.lens[4]);
    gl.uniform2f(at.range, field ? (low - field.low) / spread : 0, field ? (high - field.low) / spread : 1);
    gl.uniform3fv(at.towards, scene ? rows.map(row => row[0] * light.towards[0] + row[1] * light.towards[1] + row[2] * light.towards[2]) : fromTheRight);
    return at;
  };
  const attribute = (k, buffer, size, type, normalised) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(k);
    gl.vertexAttribPointer(k, size, type, normalised, 0, 0);
  };
  const drawSurface = () => {
    attribute(0, buffers.surfels[0], 3, gl.UNSIGNED_SHORT, true);
    attribute(1, buffers.surfels[1], 1, gl.UNSIGNED_SHORT, true);
    attribute(2, buffers.surfels[2], 4, gl.BYTE, true);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
  };
  const drawBalls = (at, size) => {
    gl.disableVertexAttribArray(2);
    gl.uniform1f(at.ball, size);
    attribute(0, buffers.phyxels[0], 3, gl.UNSIGNED_SHORT, true);
    attribute(1, buffers.phyxels[1], 1, gl.UNSIGNED_SHORT, true);
    gl.drawArrays(gl.POINTS, 0, data.phyxels);
  };
  const surface = shown.surface && frame.surfels, balls = shown.phyxels && frame.phyxels;
  if (scene) {
    const lightEye = {turn: columns(light.rows.flat()), eye: [0, 0, 0], lens: [1 / lit, 1 / lit, -1 / lightDepth, 0, 1]};
    drawShadows(frame.number, program => use(lightEye, program), () => {
      if (surface) { use(lightEye, programs.casting); drawSurface(); }
      else if (balls) drawBalls(use(lightEye, programs.castingBalls), data.spacing * 0.7 * texels / 2 / lit);
    });
  }
  gl.viewport(0, 0, width, height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  if (surface) {
    const at = use(eye, programs.surface);
    bindShadows(at, scene);
    drawSurface();
  }
  if (balls) {
    const at = use(eye, programs.balls);
    drawBalls(at, data.spacing * 0.7 * focal * height / 2 * (shown.surface ? 0.5 : 1));
  }
  if (scene) drawObstacles(frame.number, program => { const at = use(eye, program); bindShadows(at, true); return at; });
}

// --- charts --------------------------------------------------------------------------------------
const charts = [];
function addCharts() {
  const column = name => data.log.columns.findIndex(c => c.split(' [')[0] === name);
  const values = name => data.log.rows.map(row => row[column(name)]);
  const moving = name => column(name) >= 0 && values(name).some(v => Math.abs(v) > 0);
  const chart = (title, y, names, labels) => {
    const present = names.filter(moving);
    if (!present.length || data.log.rows.length < 2) return;
    const made = plot({x: 'time [s]', y, seek: time => { pause(); show(nearest(time)); },
                       series: present.map(name => ({label: labels(name), x: values('time'), y: values(name), dashed: name === 'total_energy'}))});
    charts.push(made);
    document.getElementById('charts').append(element('div', {}, element('h2', {}, title), made));
  };
  // All parts of the total: their sum is constant where the total is.
  const lost = {contact_energy: 'springs of contact', friction_heat: 'heat of friction', impact_loss: 'lost in impacts',
                other_contact_loss: 'lost otherwise in contact', plastic_work: 'plastic work', viscous_work: 'viscous work'};
  const parts = ['kinetic_energy', 'strain_energy', 'volume_energy', 'hourglass_energy', 'gravity_energy', 'load_energy'];
  chart('Energy', 'energy [J]', [...parts, ...Object.keys(lost), 'total_energy'], n => lost[n] ?? n.replace('_energy', ''));
  chart('Momentum', 'momentum [kg m/s]', ['momentum_x', 'momentum_y', 'momentum_z'], n => n.slice(-1));
  chart('Angular momentum', 'angular momentum [kg m²/s]', ['angular_momentum_x', 'angular_momentum_y', 'angular_momentum_z'], n => n.slice(-1));
  chart('Largest displacement', 'displacement [m]', ['largest_displacement'], () => 'largest displacement');
}
function nearest(time) {
  let best = 0;
  frames.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(frames[best] - time)) best = k; });
  return best;
}

// --- controls ------------------------------------------------------------------------------------
const slider = document.getElementById('time'), playButton = document.getElementById('play'), speed = document.getElementById('speed');
let playing = null;
function show(k) {
  shown.frame = Math.min(steps - 1, Math.max(0, k));
  slider.value = shown.frame;
  draw();
}
function pause() { if (playing) cancelAnimationFrame(playing.request); playing = null; playButton.textContent = '▶ Play'; }
function play() {
  if (steps < 2) return;
  if (shown.frame === steps - 1) show(0);
  playing = {since: performance.now(), from: frames[shown.frame]};
  playButton.textContent = '❚❚ Pause';
  const tick = () => {
    const time = playing.from + (performance.now() - playing.since) / 1000 * Number(speed.value);
    let k = shown.frame;
    while (k + 1 < steps && frames[k + 1] <= time) ++k;
    if (k !== shown.frame) show(k);
    if (k === steps - 1) { pause(); return; }
    playing.request = requestAnimationFrame(tick);
  };
  playing.request = requestAnimationFrame(tick);
}
/// Colours show a field, by the scale that suits it.
function choose(field) {
  const box = document.getElementById('log'), chosen = data.fields[field];
  shown.field = field;
  box.disabled = !chosen || !(chosen.decades[0] > 0);
  box.checked = shown.log = !box.disabled && chosen.log;
}
function control() {
  slider.max = steps - 1;
  slider.addEventListener('input', () => { pause(); show(Number(slider.value)); });
  playButton.addEventListener('click', () => playing ? pause() : play());
  // As fast as lets the whole be seen in ten seconds, or as it was.
  const length = frames[steps - 1] - frames[0], whole = length / 10;
  for (const factor of [0.1, 0.25, 0.5, 1, 2, 5]) speed.append(element('option', {value: factor}, `${factor} × real time`));
  if (length > 0) speed.append(element('option', {value: whole}, 'in 10 s'));
  speed.value = length > 0 && (length < 1 || length > 30) ? whole : 1;
  const field = document.getElementById('field');
  field.append(element('option', {value: -1}, 'bodies'), ...data.fields.map((f, k) => element('option', {value: k}, f.name)));
  field.value = shown.field;
  field.addEventListener('change', () => { choose(Number(field.value)); draw(); });
  const log = document.getElementById('log');
  log.addEventListener('change', () => { shown.log = log.checked; draw(); });
  choose(shown.field);
  const range = document.getElementById('range');
  range.addEventListener('change', () => { shown.range = range.value; draw(); });
  for (const [name, count] of [['surface', data.surfels], ['phyxels', data.phyxels], ['obstacles', obstacles.length]]) {
    const box = document.getElementById(name);
    box.checked = shown[name]; box.disabled = !count;
    box.addEventListener('change', () => { shown[name] = box.checked; draw(); });
  }
  document.getElementById('with-obstacles').hidden = !obstacles.length;
  if (data.only_floor) document.querySelector('#with-obstacles span').textContent = 'floor';
  document.getElementById('reset').addEventListener('click', () => { startView(); draw(); });
  const pointers = new Map();
  canvas.addEventListener('pointerdown', event => { canvas.setPointerCapture(event.pointerId); pointers.set(event.pointerId, event); });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, event => pointers.delete(event.pointerId));
  canvas.addEventListener('pointermove', event => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
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
  document.addEventListener('keydown', event => {
    if (['INPUT', 'SELECT', 'TEXTAREA'].includes(event.target.tagName) && event.target.type !== 'range') return;
    if (event.key === ' ') { event.preventDefault(); playing ? pause() : play(); }
    if (event.target.type === 'range') return;
    if (event.key === 'ArrowRight') { pause(); show(shown.frame + 1); }
    if (event.key === 'ArrowLeft') { pause(); show(shown.frame - 1); }
    if (event.key === 'Home') { pause(); show(0); }
    if (event.key === 'End') { pause(); show(steps - 1); }
  });
  new ResizeObserver(draw).observe(canvas);
}

function addTiming() {
  const longest = Math.max(...data.timing.map(([, seconds]) => seconds), 1e-9);
  document.getElementById('timing').append(element('table', {}, ...data.timing.map(([name, seconds]) => element('tr', {},
    element('td', {}, name), element('td', {class: 'number'}, `${short(seconds)} s`),
    element('td', {style: 'width: 50%'}, element('div', {class: 'bar', style: `width: ${100 * seconds / longest}%`}))))));
}

/// For whoever tests the page: how much of the stage is drawn on, and what went wrong.
function tell(state) {
  document.body.dataset.state = state;
  if (!gl) return;
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let drawn = 0;
  for (let k = 3; k < pixels.length; k += 4) if (pixels[k]) ++drawn;
  document.body.dataset.drawn = (drawn / (canvas.width * canvas.height)).toFixed(4);
  document.body.dataset.frame = shown.frame;
  document.body.dataset.obstacles = scenery.parts.length;
  document.body.dataset.error = gl.getError();
}

addCharts();
if (data.timing.length) addTiming();
else document.getElementById('timing-title').hidden = true;
if (gl) prepare();
else stage.append(element('p', {class: 'refusal'}, 'This browser has no WebGL 2, which the moving picture needs; the plots below do not.'));
const asked = new URLSearchParams(location.hash.slice(1));  // #t=0.5&colours=speed&obstacles=off&play&video
const colouring = asked.get('colours');
if (colouring === 'bodies') shown.field = -1;
else if (data.fields.some(f => f.name === colouring)) shown.field = data.fields.findIndex(f => f.name === colouring);
if (asked.get('obstacles') === 'off') shown.obstacles = false;
startView();
control();
show(asked.has('t') ? nearest(Number(asked.get('t'))) : data.opening.frame);
tell(gl ? 'drawn' : 'no WebGL 2');
if (asked.has('play')) play();
