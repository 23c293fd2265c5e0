// Colours of fields and bodies, in shaders and in the bar.
// Viridis, by a polynomial of degree six (Matt Zucker's fit, public domain).
const ramp = `
vec3 ramp(float t) {
  t = clamp(t, 0.0, 1.0);
  const vec3 c0 = vec3(0.2777273272234177, 0.005407344544966578, 0.3340998053353061);
  const vec3 c1 = vec3(0.1050930431085774, 1.404613529898575, 1.384590162594685);
  const vec3 c2 = vec3(-0.3308618287255563, 0.214847559468213, 0.09509516302823659);
  const vec3 c3 = vec3(-4.634230498983486, -5.799100973351585, -19.33244095627987);
  const vec3 c4 = vec3(6.228269936347081, 14.17993336680509, 56.69055260068105);
  const vec3 c5 = vec3(4.776384997670288, -13.74514537774601, -65.35303263337234);
  const vec3 c6 = vec3(-5.435455855934631, 4.645852612178535, 26.3124352495832);
  return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6)))));
}
// The colour of a body in the pictures of phyxel render, by OKLCH (Ottosson 2020); hues are a golden angle apart.
vec3 bodyColour(float body) {
  float hue = radians(165.0 + 137.508 * body), a = 0.095 * cos(hue), b = 0.095 * sin(hue);
  vec3 lms = vec3(0.8 + 0.3963377774 * a + 0.2158037573 * b, 0.8 - 0.1055613458 * a - 0.0638541728 * b, 0.8 - 0.0894841775 * a - 1.2914855480 * b);
  lms = lms * lms * lms;
  vec3 linear = vec3(4.0767416621 * lms.x - 3.3077115913 * lms.y + 0.2309699292 * lms.z, -1.2684380046 * lms.x + 2.6097574011 * lms.y - 0.3413193965 * lms.z,
                     -0.0041960863 * lms.x - 0.7034186147 * lms.y + 1.7076147010 * lms.z);
  return pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2));
}
uniform float bodies;  // 1 if values are numbers of bodies over 65535
vec3 baseColour(float value) { return bodies > 0.0 ? bodyColour(round(65535.0 * value)) : ramp(value); }`;
function rampColour(t) {
  const c = [[0.2777273, 0.1050930, -0.3308618, -4.6342305, 6.2282699, 4.7763850, -5.4354559],
             [0.0054073, 1.4046135, 0.2148476, -5.7991010, 14.1799334, -13.7451454, 4.6458526],
             [0.3340998, 1.3845902, 0.0950952, -19.3324410, 56.6905526, -65.3530326, 26.3124352]];
  return c.map(k => Math.round(255 * Math.min(1, Math.max(0, k.reduceRight((sum, v) => sum * t + v, 0)))));
}

/// The bar of colours, with pointed ends where values, from least to most, lie beyond it, and its ticks.
function drawLegend(low, high, logarithmic, least, most) {
  const legend = stage.querySelector('.legend'), field = data.fields[shown.field];
  legend.hidden = !field;
  if (!field) return;
  legend.querySelector('.name').textContent = `${field.name}${field.unit ? ` [${field.unit}]` : ''}`;
  const bar = legend.querySelector('canvas'), pen = bar.getContext('2d'), end = 12, width = bar.width - 2 * end, half = bar.height / 2;
  pen.clearRect(0, 0, bar.width, bar.height);
  for (let k = 0; k < width; ++k) {
    pen.fillStyle = `rgb(${rampColour(k / (width - 1)).join()})`;
    pen.fillRect(end + k, 0, 1, bar.height);
  }
  for (const [beyond, share, tip, base] of [[least < low, 0, 1, end], [most > high, 1, bar.width - 1, bar.width - end]]) {
    if (!beyond) continue;
    pen.fillStyle = `rgb(${rampColour(share).join()})`;
    pen.beginPath(); pen.moveTo(base, 0); pen.lineTo(tip, half); pen.lineTo(base, bar.height); pen.fill();
  }
  let all = high > low ? ticks(low, high, 4) : [low];
  if (logarithmic) {
    for (const multiples of [[1], [1, 2, 5]]) {
      all = [];
      for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); ++power) all.push(...multiples.map(m => m * 10 ** power));
      all = all.filter(v => v >= low && v <= high);
      if (all.length > 1) break;
    }
  }
  const share = v => high > low ? (logarithmic ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low)) : 0;
  const label = v => logarithmic && (v >= 1000 || v < 0.01) ? v.toExponential(0).replace('+', '') : short(+v.toPrecision(6));
  legend.querySelector('.ticks').replaceChildren(...all.map(v => element('span', {style: `left: ${100 * (end + share(v) * width) / bar.width}%`}, label(v))));
}
