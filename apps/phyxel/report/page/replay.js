// A trajectory: the moving body, its energies and momenta.
const frames = data.frames, steps = frames.length;

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

/// The phyxels of a frame that have lost pairs, which are seen where the surface has opened.
function tornOf(frame) {
  const number = data.fields.findIndex(f => f.name === 'broken share');
  if (number < 0 || !frame.phyxels) return new Uint32Array(0);
  const broken = frame.phyxels.fields[number];
  return frame.torn ??= Uint32Array.from([...broken.keys()].filter(i => broken[i] > 0));
}

/// How many numbers of `triangles` a frame draws: those that no crack crosses come first.
const cornersOf = number => data.uncut ? 3 * data.uncut[number] : triangles.length;

/// Of the surface, area-weighted; in bytes for the GPU.
function normalsOf(points, corners) {
  const n = new Float32Array(points.length), [sx, sy, sz] = data.scale;
  for (let t = 0; t < corners; t += 3) {
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
let buffers = null;
const quantised = `
in vec3 point; in float field;
vec3 moved() { return point; }
vec3 turned(vec3 normal) { return normal; }
float shade() { return field; }`;
const source = {
  surfaceMotion: quantised,
  ballMotion: quantised,
  scale: sides,
  low: data.low,
  prepare() { buffers = {surfels: [0, 1, 2].map(() => gl.createBuffer()), phyxels: [0, 1].map(() => gl.createBuffer()), torn: gl.createBuffer()}; },
  frame() { return frameOf(shown.frame); },
  clock(frame) { return `t = ${frames[frame.number].toFixed(data.decimals)} s`; },
  span,
  upload,
  about() { return data.follow?.[shown.frame]; },
  phyxelAt(frame, i) { return [0, 1, 2].map(k => frame.phyxels.points[3 * i + k] * data.scale[k] + data.low[k]); },
  /// The value of a phyxel as shaders have it.
  valueAt(frame, i) { return (shown.field < 0 ? bodiesOf('phyxels') : frame.phyxels.fields[shown.field])[i] / 65535; },
  corners(frame) { return cornersOf(frame.number); },
  torn(frame) { return {count: tornOf(frame).length, buffer: buffers.torn}; },
  bindSurface() {
    attribute(0, buffers.surfels[0], 3, gl.UNSIGNED_SHORT, true);
    attribute(1, buffers.surfels[1], 1, gl.UNSIGNED_SHORT, true);
    attribute(2, buffers.surfels[2], 4, gl.BYTE, true);
  },
  bindBalls() {
    attribute(0, buffers.phyxels[0], 3, gl.UNSIGNED_SHORT, true);
    attribute(1, buffers.phyxels[1], 1, gl.UNSIGNED_SHORT, true);
  },
};

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
  if (frame.surfels) fill(buffers.surfels[2], frame.surfels.normals ??= normalsOf(frame.surfels.points, cornersOf(frame.number)));
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.torn);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, tornOf(frame), gl.DYNAMIC_DRAW);
  uploaded = key;
}

/// What the colours span, in units of the field: low, high, and whether by their logarithms; and what 16 bits span.
function span(frame) {
  const field = data.fields[shown.field];
  if (!field) return {low: 0, high: 1, logarithmic: false, from: 0, to: 1};
  const bits = {from: field.low, to: field.high};
  const log = shown.log && field.decades[0] > 0;
  if (shown.range === 'bulk') {
    const [low, high] = log ? field.decades : field.bulk;
    return {low, high, logarithmic: log, ...bits};
  }
  let [low, high] = [field.low, field.high];
  if (shown.range === 'one') {
    const f = fieldOf(frame, frame.surfels && (shown.surface || !frame.phyxels) ? 'surfels' : 'phyxels', shown.field);
    let least = 65535, most = 0;
    for (const v of f) { if (v < least) least = v; if (v > most) most = v; }
    [low, high] = [least, most].map(v => field.low + v / 65535 * (field.high - field.low));
  }
  const logarithmic = log && high > 0;
  return {low: logarithmic ? Math.max(low, high / 1000) : low, high, logarithmic, ...bits};
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
                other_contact_loss: 'lost otherwise in contact', plastic_work: 'plastic work', viscous_work: 'viscous work', fracture_energy: 'taken by fracture'};
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
  for (const chart of charts) chart.now(frames[shown.frame]);
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
  controlShown();
  const field = document.getElementById('field');
  field.addEventListener('change', () => { choose(Number(field.value)); draw(); });
  const log = document.getElementById('log');
  log.addEventListener('change', () => { shown.log = log.checked; draw(); });
  choose(shown.field);
  const range = document.getElementById('range');
  range.addEventListener('change', () => { shown.range = range.value; draw(); });
  controlCut();
  watchPointers();
  document.addEventListener('keydown', event => {
    if (['INPUT', 'SELECT', 'TEXTAREA'].includes(event.target.tagName) && event.target.type !== 'range') return;
    if (event.key === ' ') { event.preventDefault(); playing ? pause() : play(); }
    if (event.target.type === 'range') return;
    if (event.key === 'ArrowRight') { pause(); show(shown.frame + 1); }
    if (event.key === 'ArrowLeft') { pause(); show(shown.frame - 1); }
    if (event.key === 'Home') { pause(); show(0); }
    if (event.key === 'End') { pause(); show(steps - 1); }
  });
}

function addTiming() {
  const longest = Math.max(...data.timing.map(([, seconds]) => seconds), 1e-9);
  document.getElementById('timing').append(element('table', {}, ...data.timing.map(([name, seconds]) => element('tr', {},
    element('td', {}, name), element('td', {class: 'number'}, `${short(seconds)} s`),
    element('td', {style: 'width: 50%'}, element('div', {class: 'bar', style: `width: ${100 * seconds / longest}%`}))))));
}

addCharts();
if (data.timing.length) addTiming();
else document.getElementById('timing-title').hidden = true;
if (gl) prepare();
else stage.append(element('p', {class: 'refusal'}, 'This browser has no WebGL 2, which the moving picture needs; the plots below do not.'));
const asked = new URLSearchParams(location.hash.slice(1));  // #t=0.5&colours=speed&obstacles=off&cut=y:0.1&play&video&orbit=90
const colouring = asked.get('colours');
if (colouring === 'bodies') shown.field = -1;
else if (data.fields.some(f => f.name === colouring)) shown.field = data.fields.findIndex(f => f.name === colouring);
if (asked.get('obstacles') === 'off') shown.obstacles = false;
startView();
control();
show(asked.has('t') ? nearest(Number(asked.get('t'))) : data.opening.frame);
tell(gl ? 'drawn' : 'no WebGL 2');
if (asked.has('play')) play();
