'use strict';
// The data, elements, numbers and plots of the page.
const data = JSON.parse(document.getElementById('data').textContent);
const colours = ['#1f6fb2', '#d1495b', '#2f9e6e', '#e09f1f', '#7b5cc4', '#11a0b5', '#8a6b4d', '#c4559f', '#6b7a8f', '#9aa812', '#3f4fa8', '#e07a5f', '#4d5b2b'];

function element(name, attributes = {}, ...children) {
  const svg = ['svg', 'path', 'line', 'text'].includes(name);
  const made = svg ? document.createElementNS('http://www.w3.org/2000/svg', name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/// A number with four digits.
function short(value) {
  if (!Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  if (value === 0) return '0';
  if (size >= 1e5 || size < 1e-3) return value.toExponential(2).replace(/\.?0*e\+?/, 'e');
  return String(+value.toPrecision(4));
}

/// About `count` round numbers between two numbers.
function ticks(low, high, count) {
  const raw = (high - low) / count, unit = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(m => m * unit).find(s => s >= raw) || raw;
  const all = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) all.push(k * step);
  return all;
}

/// Curves over axes. chart: {x, y, series: [{label, x, y, dashed, colour}], seek}. Returns the element, whose `now(x)`
/// moves a line to x.
function plot(chart) {
  const width = 640, height = 300, left = 76, right = 12, top = 12, bottom = 42;
  const range = axis => {
    let low = Infinity, high = -Infinity;
    for (const s of chart.series) {
      s[axis].forEach((v, k) => {
        if (!Number.isFinite(s.x[k]) || !Number.isFinite(s.y[k])) return;
        low = Math.min(low, v); high = Math.max(high, v);
      });
    }
    if (low > high) return [0, 1];
    const pad = low === high ? Math.abs(low) * 0.1 || 1 : (axis === 'y' ? 0.05 * (high - low) : 0);
    return [low - pad, high + pad];
  };
  const [x0, x1] = range('x'), [y0, y1] = range('y');
  const px = v => left + (v - x0) / (x1 - x0) * (width - left - right);
  const py = v => height - bottom - (v - y0) / (y1 - y0) * (height - top - bottom);
  const svg = element('svg', {class: 'plot', viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': `${chart.y} over ${chart.x}`});
  for (const v of ticks(x0, x1, 6)) {
    svg.append(element('line', {class: 'grid', x1: px(v), x2: px(v), y1: top, y2: height - bottom}),
               element('text', {x: px(v), y: height - bottom + 16, 'text-anchor': 'middle'}, short(v)));
  }
  for (const v of ticks(y0, y1, 5)) {
    svg.append(element('line', {class: 'grid', x1: left, x2: width - right, y1: py(v), y2: py(v)}),
               element('text', {x: left - 6, y: py(v) + 4, 'text-anchor': 'end'}, short(v)));
  }
  svg.append(element('text', {x: (left + width - right) / 2, y: height - 8, 'text-anchor': 'middle'}, chart.x),
             element('text', {transform: `translate(14 ${(top + height - bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle'}, chart.y));
  chart.series.forEach((s, n) => {
    const colour = s.colour || colours[n % colours.length];
    let path = '', drawing = false;
    s.x.forEach((v, k) => {
      const fine = Number.isFinite(v) && Number.isFinite(s.y[k]);
      if (fine) path += `${drawing ? 'L' : 'M'}${px(v).toFixed(1)} ${py(s.y[k]).toFixed(1)}`;
      drawing = fine;
    });
    svg.append(element('path', {d: path, fill: 'none', stroke: colour, 'stroke-width': 1.8, ...(s.dashed ? {'stroke-dasharray': '5 4'} : {})}));
  });
  const line = element('line', {class: 'now', y1: top, y2: height - bottom, visibility: 'hidden'});
  svg.append(line);
  if (chart.seek) {
    svg.style.cursor = 'crosshair';
    svg.addEventListener('click', event => {
      const box = svg.getBoundingClientRect();
      const at = ((event.clientX - box.left) / box.width * width - left) / (width - left - right);
      chart.seek(x0 + Math.min(1, Math.max(0, at)) * (x1 - x0));
    });
  }
  const keys = element('div', {class: 'keys'}, ...chart.series.map((s, n) => element('span', {}, element('i', {style: `background:${s.colour || colours[n % colours.length]}`}), s.label)));
  const whole = element('div', {}, svg, keys);
  whole.now = x => {
    line.setAttribute('visibility', 'visible');
    line.setAttribute('x1', px(x)); line.setAttribute('x2', px(x));
  };
  return whole;
}
