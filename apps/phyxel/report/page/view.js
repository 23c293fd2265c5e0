// A live view: frames of phyxels come through a socket, shaders carry the surface along, and the pointer pulls bodies.
const asked = new URLSearchParams(location.hash.slice(1));  // #colours=speed&phyxels&cut=y:0.1
const rest = {surfels: data.surfels ? new Float32Array(bytesOf('rest-surfels')) : null, phyxels: new Float32Array(bytesOf('rest-phyxels'))}, ids = new Uint32Array(bytesOf('ids'));
const carriers = data.surfels ? new Uint32Array(bytesOf('carriers')) : null, weights = data.surfels ? new Uint8Array(bytesOf('weights')) : null;
const each = data.carriers, numbersEach = 16, stepsOfNumbers = 32767, perRow = 256;  // phyxels in a row of the texture of motions

/// A frame as it came.
function decoded(buffer) {
  const head = new DataView(buffer), float = k => head.getFloat32(24 + 4 * k, true), three = k => [float(k), float(k + 1), float(k + 2)];
  const frame = {number: head.getUint32(4, true), phyxels: head.getUint32(8, true), field: head.getInt32(12, true), time: head.getFloat64(16, true),
                 middle: three(0), half: three(3), steep: float(6), low: float(7), high: float(8), surfels: data.surfels > 0};
  frame.numbers = new Int16Array(buffer, 64, numbersEach * frame.phyxels);
  const places = new Float32Array(buffer, 64 + 2 * numbersEach * frame.phyxels);
  frame.places = [];
  for (let k = 0; k + 12 <= places.length; k += 12) frame.places.push([...places.subarray(k, k + 9), ...[0, 1, 2].map(c => (places[k + 9 + c] - data.centre[c]) / data.radius)]);
  return frame;
}

/// Where a surfel is in a frame, in units of the radius, as the shader has it.
function surfelAt(frame, s) {
  const at = [0, 0, 0];
  for (let c = 0; c < each; ++c) {
    const i = carriers[each * s + c], w = weights[each * s + c] / 255, k = numbersEach * i;
    if (!w) continue;
    const d = [0, 1, 2].map(a => rest.surfels[3 * s + a] - rest.phyxels[3 * i + a]);
    for (let a = 0; a < 3; ++a) {
      const u = (frame.middle[a] + frame.half[a] * frame.numbers[k + a] / stepsOfNumbers) / data.radius;
      const g = [0, 1, 2].reduce((sum, b) => sum + frame.numbers[k + 4 + 4 * a + b] * d[b], 0) * frame.steep / stepsOfNumbers;
      at[a] += w * (rest.surfels[3 * s + a] + u + g);
    }
  }
  return at;
}
function phyxelAt(frame, i) {
  return [0, 1, 2].map(a => rest.phyxels[3 * i + a] + (frame.middle[a] + frame.half[a] * frame.numbers[numbersEach * i + a] / stepsOfNumbers) / data.radius);
}

// --- what the stage draws ------------------------------------------------------------------------
const motionOfCarriers = `
uniform highp isampler2D motion; uniform highp sampler2D restOf; uniform vec3 middle, half_; uniform float steep, ofBodies;
ivec4 of(int i, int part) { return texelFetch(motion, ivec2(4 * (i % ${perRow}) + part, i / ${perRow}), 0); }
vec4 resting(int i) { return texelFetch(restOf, ivec2(i % ${perRow}, i / ${perRow}), 0); }
vec3 shift(ivec4 first) { return middle + half_ * vec3(first.xyz) / ${stepsOfNumbers}.0; }
float hue(ivec4 first, vec4 at) { return ofBodies > 0.0 ? at.w / 65535.0 : 0.5 + 0.5 * float(first.w) / ${stepsOfNumbers}.0; }`;
const source = {
  /// Equation (6) of Farias et al. 2008 with the nearest carriers: X + Σ w (u + ∇u (X - X_carrier)).
  surfaceMotion: motionOfCarriers + `
in vec3 point; in uvec4 carriers; in vec4 weights;
float carried; vec3 row0, row1, row2;
vec3 moved() {
  vec3 sum = vec3(0.0);
  carried = 0.0; row0 = vec3(0.0); row1 = vec3(0.0); row2 = vec3(0.0);
  for (int c = 0; c < 4; ++c) {
    int i = int(carriers[c]);
    float w = weights[c];
    ivec4 first = of(i, 0);
    vec4 at = resting(i);
    vec3 a = vec3(of(i, 1).xyz), b = vec3(of(i, 2).xyz), g = vec3(of(i, 3).xyz), d = point - at.xyz;
    sum += w * (point + shift(first) + steep / ${stepsOfNumbers}.0 * vec3(dot(a, d), dot(b, d), dot(g, d)));
    row0 += w * a; row1 += w * b; row2 += w * g;
    carried += w * hue(first, at);
  }
  return sum;
}
vec3 turned(vec3 normal) {
  mat3 f = mat3(1.0) + steep / ${stepsOfNumbers}.0 * transpose(mat3(row0, row1, row2));
  return mat3(cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])) * normal;
}
float shade() { return carried; }`,
  ballMotion: motionOfCarriers + `
in vec3 point;
vec3 moved() { return point + shift(of(gl_VertexID, 0)); }
float shade() { return hue(of(gl_VertexID, 0), resting(gl_VertexID)); }`,
  scale: [1, 1, 1],
  low: [0, 0, 0],
  prepare() {
    const bodies = this.bodies = bodiesOf('phyxels'), rows = Math.ceil(data.phyxels / perRow);
    const texture = (unit, format, width) => {
      const made = gl.createTexture();
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, rows);
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    };
    texture(2, gl.RGBA16I, 4 * perRow);
    texture(3, gl.RGBA32F, perRow);
    const places = new Float32Array(4 * perRow * rows);
    for (let i = 0; i < data.phyxels; ++i) places.set([...rest.phyxels.subarray(3 * i, 3 * i + 3), bodies[i]], 4 * i);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, perRow, rows, gl.RGBA, gl.FLOAT, places);
    this.rows = rows;
    this.padded = new Int16Array(numbersEach * perRow * rows);
    this.balls = filled(gl.ARRAY_BUFFER, rest.phyxels);
    if (data.surfels) this.surface = [filled(gl.ARRAY_BUFFER, rest.surfels), filled(gl.ARRAY_BUFFER, restNormals()), filled(gl.ARRAY_BUFFER, carriers), filled(gl.ARRAY_BUFFER, weights)];
  },
  frame() { return latest; },
  clock(frame) { return `t = ${frame.time.toFixed(Math.max(2, Math.ceil(-Math.log10(60 * data.step))))} s`; },
  span(frame) {
    const {low, high} = range, top = Math.max(high, low + 1e-300);
    const logarithmic = shown.log && high > 0;
    return {low: logarithmic ? Math.max(low, top / 1000) : low, high: top, logarithmic, from: frame.low, to: Math.max(frame.high, frame.low + 1e-300)};
  },
  upload(frame) {
    if (this.uploaded === frame) return;
    this.padded.set(frame.numbers);
    gl.activeTexture(gl.TEXTURE2);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 4 * perRow, this.rows, gl.RGBA_INTEGER, gl.SHORT, this.padded);
    this.uploaded = frame;
    frame.places.forEach((place, k) => { if (obstacles[k]) obstacles[k].places = [place]; });
  },
  bind(at) {
    gl.uniform1i(at.motion, 2);
    gl.uniform1i(at.restOf, 3);
    gl.uniform3fv(at.middle, latest.middle.map(x => x / data.radius));
    gl.uniform3fv(at.half_, latest.half.map(x => x / data.radius));
    gl.uniform1f(at.steep, latest.steep);
    gl.uniform1f(at.ofBodies, shown.field < 0 ? 1 : 0);
  },
  bindSurface(at) {
    this.bind(at);
    attribute(0, this.surface[0], 3, gl.FLOAT, false);
    attribute(2, this.surface[1], 3, gl.FLOAT, false);
    gl.disableVertexAttribArray(1);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.surface[2]);
    gl.enableVertexAttribArray(3);
    gl.vertexAttribIPointer(3, 4, gl.UNSIGNED_INT, 0, 0);
    attribute(4, this.surface[3], 4, gl.UNSIGNED_BYTE, true);
  },
  bindBalls(at) {
    this.bind(at);
    for (const k of [1, 3, 4]) gl.disableVertexAttribArray(k);
    attribute(0, this.balls, 3, gl.FLOAT, false);
  },
  about() { return followed; },
  phyxelAt(frame, i) { return phyxelAt(frame, i); },
  /// The value of a phyxel as shaders have it.
  valueAt(frame, i) { return shown.field < 0 ? this.bodies[i] / 65535 : 0.5 + 0.5 * frame.numbers[numbersEach * i + 3] / stepsOfNumbers; },
  farther() { return farther; },
  takes(event) {
    if (!hand || event.pointerId !== hand.pointer) return false;
    moveHand(event);
    return true;
  },
};

/// Normals of the surface at rest, area-weighted.
function restNormals() {
  const p = rest.surfels, n = new Float32Array(p.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map(k => 3 * triangles[t + k]);
    const u = [0, 1, 2].map(k => p[b + k] - p[a + k]), v = [0, 1, 2].map(k => p[c + k] - p[a + k]);
    const area = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const i of [a, b, c]) for (let k = 0; k < 3; ++k) n[i + k] += area[k];
  }
  return n;
}

// --- the hand ------------------------------------------------------------------------------------
let latest = null, hand = null, followed = [0, 0, 0], farther = 1;  // the middle of the displacements and their extent, which the view follows
const lag = 0.15, mostFarther = 3;
const line = element('line', {stroke: '#d1495b', 'stroke-width': 2, visibility: 'hidden'});
const overlay = element('svg', {style: 'position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none'}, line);
stage.append(overlay);

/// The ray through a place on the stage: the eye, and a direction, in units of the radius.
function rayAt(event) {
  const box = canvas.getBoundingClientRect(), aspect = box.width / box.height, rows = matrix(view), eye = eyeOf(rows, aspect);
  const x = (2 * (event.clientX - box.left) / box.width - 1) * aspect / focal(aspect), y = (1 - 2 * (event.clientY - box.top) / box.height) / focal(aspect);
  const from = v => [0, 1, 2].map(k => rows[0][k] * v[0] + rows[1][k] * v[1] + rows[2][k] * v[2]);
  return {eye: from(eye), way: from([x, y, -1]), back: rows[2]};
}
/// Where a place is on the stage, in pixels.
function onStage(p) {
  const aspect = canvas.clientWidth / canvas.clientHeight, rows = matrix(view), eye = eyeOf(rows, aspect);
  const seen = rows.map((row, k) => dot3(row, p) - eye[k]);
  const lens = focal(aspect);
  return [(1 + lens / aspect * seen[0] / -seen[2]) / 2 * canvas.clientWidth, (1 - lens * seen[1] / -seen[2]) / 2 * canvas.clientHeight];
}
const less = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/// The phyxel under a ray, and where it is hit; null if there is none. Source of the test of triangles: Möller and Trumbore 1997.
function hitBy({eye, way}) {
  let best = null;
  if (shown.surface && data.surfels) {
    const at = [];
    for (let s = 0; s < data.surfels; ++s) at.push(surfelAt(latest, s));
    for (let t = 0; t < triangles.length; t += 3) {
      const a = at[triangles[t]], e1 = less(at[triangles[t + 1]], a), e2 = less(at[triangles[t + 2]], a), p = cross3(way, e2), det = dot3(e1, p);
      if (Math.abs(det) < 1e-14) continue;
      const from = less(eye, a), u = dot3(from, p) / det, q = cross3(from, e1), v = dot3(way, q) / det, far = dot3(e2, q) / det;
      if (u < 0 || v < 0 || u + v > 1 || far <= 0 || (best && far >= best.far)) continue;
      const nearest = [1 - u - v, u, v].reduce((most, w, k, all) => w > all[most] ? k : most, 0);
      best = {far, surfel: triangles[t + nearest]};
    }
    if (best) {
      const of = each * best.surfel;
      let heaviest = 0;
      for (let c = 1; c < each; ++c) if (weights[of + c] > weights[of + heaviest]) heaviest = c;
      best.phyxel = carriers[of + heaviest];
    }
  } else {
    const length = Math.hypot(...way);
    for (let i = 0; i < data.phyxels; ++i) {
      const from = less(phyxelAt(latest, i), eye), far = dot3(from, way) / length ** 2;
      if (far <= 0 || (best && far >= best.far)) continue;
      if (Math.hypot(...less(from, way.map(x => far * x))) < 0.5 * data.spacing) best = {far, phyxel: i};
    }
  }
  if (best) best.place = eye.map((x, k) => x + best.far * way[k]);
  return best;
}

function grab(event) {
  if (!latest || !steers || event.button || event.shiftKey) return;
  const ray = rayAt(event), hit = hitBy(ray);
  if (!hit) return;
  hand = {pointer: event.pointerId, place: hit.place, back: ray.back, phyxel: hit.phyxel, offset: less(hit.place, phyxelAt(latest, hit.phyxel))};
  send({do: 'grab', phyxel: ids[hit.phyxel]});
}
function moveHand(event) {
  const {eye, way} = rayAt(event), far = dot3(less(hand.place, eye), hand.back) / dot3(way, hand.back);
  hand.by = [0, 1, 2].map(k => (eye[k] + far * way[k] - hand.place[k]) * data.radius);
  if (hand.by.every(Number.isFinite)) send({do: 'move', by: hand.by});
  showHand();
}
function drop(event) {
  if (!hand || event.pointerId !== hand.pointer) return;
  hand = null;
  send({do: 'drop'});
  showHand();
}
function showHand() {
  line.setAttribute('visibility', hand?.by ? 'visible' : 'hidden');
  if (!hand?.by) return;
  const [x1, y1] = onStage(phyxelAt(latest, hand.phyxel).map((x, k) => x + hand.offset[k])), [x2, y2] = onStage(hand.place.map((x, k) => x + hand.by[k] / data.radius));
  for (const [name, value] of Object.entries({x1, y1, x2, y2})) line.setAttribute(name, value);
}

// --- the stream ----------------------------------------------------------------------------------
let steers = false, playing = true, frames = 0, range = {low: 0, high: 0}, unseen = 0;
const socket = new WebSocket(`ws://${location.host}/live${location.search}`);
socket.binaryType = 'arraybuffer';
function send(what) { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(what)); }
function tellUser(text) {
  const place = document.getElementById('message');
  place.textContent = text;
  place.hidden = !text;
}
socket.onmessage = event => typeof event.data === 'string' ? hear(JSON.parse(event.data)) : receive(decoded(event.data));
socket.onclose = () => { tellUser('The program has ended, or the connection is lost. This page shows the last frame.'); document.body.dataset.state = 'closed'; };

/// The range of most values of a frame's field: colours leave two in a hundred out at each end.
function bulkOf(frame) {
  const count = frame.phyxels, every = 1 + Math.floor(count / 2000), values = [];
  for (let i = 0; i < count; i += every) values.push(frame.numbers[numbersEach * i + 3]);
  values.sort((a, b) => a - b);
  const at = share => frame.low + (frame.high - frame.low) * (values[Math.round(share * (values.length - 1))] / stepsOfNumbers + 1) / 2;
  return [at(0.02), at(0.98)];
}
function receive(frame) {
  if (frame.field === shown.field) {  // a frame under way may still have another field; the range widens, and narrows slowly
    const [low, high] = bulkOf(frame), slow = (from, to) => from + 0.02 * (to - from);
    range = frame.field === range.field ? {field: frame.field, low: Math.min(low, slow(range.low, low)), high: Math.max(high, slow(range.high, high))} : {field: frame.field, low, high};
  }
  if (document.getElementById('follow').checked && !hand) {
    const share = latest && frame.time >= latest.time ? lag : 1;
    followed = followed.map((x, k) => x + share * (frame.middle[k] / data.radius - x));
    farther += share * (Math.min(mostFarther, 1 + 0.8 * Math.max(...frame.half) / data.radius) - farther);
  }
  latest = frame;
  ++frames;
  if (++unseen > 1) return;  // the one before is still to be drawn; this one will be instead
  requestAnimationFrame(() => {
    draw();
    showHand();
    for (; unseen > 0; --unseen) send({do: 'seen'});
    if (frames % 10 === 1) tell('live');
    document.body.dataset.frames = frames;
  });
}
function hear(message) {
  if (message.role) { steers = message.role === 'steers'; document.body.dataset.role = message.role; tellUser(steers ? '' : 'Another page steers; this one watches.'); }
  if (message.message !== undefined) tellUser(message.message);
  if (message.playing !== undefined) { playing = message.playing; document.getElementById('play').textContent = playing ? '❚❚ Pause' : '▶ Play'; }
  if (message.pace) choosePace(message.pace);
  if (message.field !== undefined) { shown.field = message.field; document.getElementById('field').value = message.field; }
  if (message.speed !== undefined) document.getElementById('speed').textContent = `runs at ${short(+message.speed.toPrecision(2))} × real time`;
  if (message.settings) for (const [name, value] of Object.entries(message.settings)) sliders[name]?.take(value);
  if (message.plot) addSample(message.plot);
}

// --- energies as they come -----------------------------------------------------------------------
const samples = [], mostSamples = 400;
let plotted = 0;
function addSample(sample) {
  if (samples.length && sample.time < samples[samples.length - 1].time) samples.length = 0;
  samples.push(sample);
  if (samples.length > mostSamples) samples.shift();
  document.body.dataset.energy = sample.energy.total;
  document.body.dataset.work = sample.work;
  if (performance.now() - plotted < 250 || samples.length < 2) return;
  plotted = performance.now();
  const names = Object.keys(sample.energy).filter(name => samples.some(s => Math.abs(s.energy[name]) > 0));
  const series = names.map(name => ({label: name, x: samples.map(s => s.time), y: samples.map(s => s.energy[name]), dashed: name === 'total'}));
  if (samples.some(s => s.work !== 0)) series.push({label: 'total without the work of the hand', x: samples.map(s => s.time), y: samples.map(s => s.energy.total - s.work), dashed: true});
  document.getElementById('charts').replaceChildren(element('div', {}, element('h2', {}, 'Energy'), plot({x: 'time [s]', y: 'energy [J]', series})));
}

// --- controls ------------------------------------------------------------------------------------
const sliders = {};
function addSlider(name, label, {least, most, value, logarithmic = false, unit, wanted}) {
  const there = v => logarithmic ? Math.log(v) : v, back = v => logarithmic ? Math.exp(v) : v;
  const input = element('input', {type: 'range', id: `set-${name}`, min: there(least), max: there(most), step: 'any'}), shownValue = element('span', {});
  const say = () => { shownValue.textContent = `${short(+back(Number(input.value)).toPrecision(3))}${unit}`; };
  input.value = there(value);
  say();
  input.addEventListener('input', say);
  input.addEventListener('change', () => { send({do: 'set', [name]: wanted(back(Number(input.value)))}); hand = null; });
  sliders[name] = {take: v => { input.value = there(Array.isArray(v) ? Math.hypot(...v) : v); say(); }};
  document.getElementById('settings').append(element('label', {class: 'slider'}, label, input, shownValue));
}
function addSliders() {
  const {gravity, stiffness, damping, friction} = data.settings, size = Math.hypot(...gravity), down = size ? gravity.map(x => x / size) : data.axes[2].map(x => -x);
  addSlider('gravity', 'gravity', {least: 0, most: Math.max(20, 2 * size), value: size, unit: ' m/s²', wanted: v => down.map(x => v * x)});
  if (stiffness) addSlider('stiffness', 'stiffness', {least: 0.1, most: 10, value: 1, logarithmic: true, unit: ' × E', wanted: v => v});
  addSlider('damping', 'damping', {least: 0, most: Math.max(20, 4 * damping), value: damping, unit: ' 1/s', wanted: v => v});
  if (friction !== undefined) addSlider('friction', 'friction', {least: 0, most: Math.max(1.5, 2 * friction), value: friction, unit: '', wanted: v => v});
}
/// Shows a pace, which may be none of those to choose from.
function choosePace(factor) {
  const pace = document.getElementById('pace');
  if (![...pace.options].some(option => Number(option.value) === factor)) pace.append(element('option', {value: factor}, `${factor} × real time`));
  pace.value = factor;
}
function control() {
  const play = document.getElementById('play'), pace = document.getElementById('pace'), field = document.getElementById('field'), log = document.getElementById('log');
  const toggle = () => send({do: playing ? 'pause' : 'play'});
  play.addEventListener('click', toggle);
  document.getElementById('step').addEventListener('click', () => send({do: 'step', count: Math.max(1, Math.round(Math.min(Number(pace.value) / 60, data.frame) / data.step))}));
  document.getElementById('restart').addEventListener('click', () => { send({do: 'reset'}); hand = null; });
  document.getElementById('save').addEventListener('click', () => send({do: 'save'}));
  for (const factor of [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2, 5]) pace.append(element('option', {value: factor}, `${factor} × real time`));
  pace.value = 1;
  controlShown();
  controlCut();
  pace.addEventListener('change', () => send({do: 'pace', factor: Number(pace.value)}));
  field.addEventListener('change', () => { shown.field = Number(field.value); send({do: 'show', field: shown.field < 0 ? 'bodies' : data.fields[shown.field].name}); draw(); });
  log.addEventListener('change', () => { shown.log = log.checked; draw(); });
  canvas.addEventListener('pointerdown', grab);
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, drop);
  document.addEventListener('keydown', event => {
    if (event.key === ' ' && !['INPUT', 'SELECT', 'BUTTON'].includes(event.target.tagName)) { event.preventDefault(); toggle(); }
  });
  addSliders();
}

if (gl) prepare();
else stage.append(element('p', {class: 'refusal'}, 'This browser has no WebGL 2, which the moving picture needs; the plots below do not.'));
startView();
control();
watchPointers();
const colouring = data.fields.findIndex(f => f.name === asked.get('colours'));
if (colouring >= 0) { shown.field = colouring; socket.addEventListener('open', () => send({do: 'show', field: asked.get('colours')})); }
if (asked.has('phyxels')) shown.phyxels = document.getElementById('phyxels').checked = true;
