// Measurements: each table with its facts, a chart over any two columns, and filters.
const isNumber = text => text !== '' && Number.isFinite(Number(text));

/// Rows that no other beats in both columns, where less is better: (row, ...) in order of x.
function front(rows, x, y) {
  const sorted = rows.filter(r => isNumber(r[x]) && isNumber(r[y])).sort((a, b) => a[x] - b[x] || a[y] - b[y]);
  let best = Infinity;
  return sorted.filter(r => { const better = Math.abs(r[y]) < best; if (better) best = Math.abs(r[y]); return better; });
}

function addTable(table) {
  const {columns, rows} = table, at = name => columns.indexOf(name);
  const numeric = columns.map((_, c) => rows.some(r => isNumber(r[c])) && rows.every(r => r[c] === '' || isNumber(r[c]) || /^[-+]?(inf|nan)$/.test(r[c])));
  const distinct = columns.map((_, c) => [...new Set(rows.map(r => r[c]))]);
  const numbers = columns.map((_, c) => c).filter(c => numeric[c] && distinct[c].length > 1);
  const choices = columns.map((_, c) => c).filter(c => distinct[c].length > 1 && distinct[c].length <= 24 && (!numeric[c] || distinct[c].length <= 8));
  const first = (names, otherwise) => names.map(at).find(c => c >= 0 && numbers.includes(c)) ?? otherwise;
  const state = {
    x: first(['seconds', 'ranks', 'objects', 'young_pa', 'time_s', 'phyxels', 'steps'], numbers[0]),
    y: first(['error', 'ms_per_frame', 'phyxel_steps_per_s', 'relative_error', 'stress_error', 'measured_bytes'], numbers[numbers.length - 1]),
    group: ['program', 'precision', 'lattice'].map(at).find(c => choices.includes(c)) ?? choices.find(c => !numeric[c] && distinct[c].length <= 10) ?? -1, sort: -1, down: false, filters: new Map(),
  };
  // Cases and quantities do not belong in one chart.
  for (const name of ['case', 'quantity']) if (choices.includes(at(name)) && at(name) !== state.group) state.filters.set(at(name), distinct[at(name)][0]);
  const spread = c => { const v = rows.map(r => Math.abs(Number(r[c]))).filter(n => n > 0); return v.length ? Math.max(...v) / Math.min(...v) : 1; };
  const boxes = {x: element('input', {type: 'checkbox'}), y: element('input', {type: 'checkbox'})};
  for (const axis of ['x', 'y']) boxes[axis].checked = state[axis] !== undefined && spread(state[axis]) > 30;

  const section = element('section', {});
  const chartPlace = element('div', {}), tablePlace = element('div', {class: 'wide'}), count = element('p', {class: 'under'});
  const picker = (label, options, value, change) => {
    const select = element('select', {onchange: () => change(select.value)}, ...options.map(([v, text]) => element('option', {value: v}, text)));
    select.value = value;
    return element('label', {}, label, ' ', select);
  };
  const named = list => list.map(c => [c, columns[c]]);
  const fits = r => [...state.filters].every(([c, v]) => v === '' || r[c] === v);
  const draw = () => {
    const chosen = rows.filter(fits);
    const {x, y, group} = state, best = x !== undefined && y !== undefined && x !== y && /error/.test(columns[y]) && /seconds|time|ms/.test(columns[x]) ? new Set(front(chosen, x, y)) : new Set();
    chartPlace.replaceChildren();
    if (x !== undefined && y !== undefined) {
      const groups = group < 0 ? [['all', chosen]] : distinct[group].map(v => [`${columns[group]} ${v}`, chosen.filter(r => r[group] === v)]);
      const series = groups.filter(([, r]) => r.length).map(([label, r]) => {
        const usable = r.filter(row => isNumber(row[x]) && isNumber(row[y]));
        return {label, points: true, x: usable.map(row => Number(row[x])), y: usable.map(row => boxes.y.checked ? Math.abs(Number(row[y])) : Number(row[y])),
                titles: usable.map(row => columns.map((c, k) => `${c}: ${row[k]}`).join('\n'))};
      });
      if (best.size > 1) {
        const line = [...best];
        series.push({label: 'Pareto front: none is both faster and better', colour: '#888', x: line.map(r => Number(r[x])), y: line.map(r => Math.abs(Number(r[y])))});
      }
      chartPlace.append(plot({x: columns[x], y: columns[y], logX: boxes.x.checked, logY: boxes.y.checked, series}));
    }
    const sorted = state.sort < 0 ? chosen : [...chosen].sort((a, b) => {
      const order = numeric[state.sort] ? Number(a[state.sort]) - Number(b[state.sort]) : a[state.sort].localeCompare(b[state.sort]);
      return state.down ? -order : order;
    });
    const most = 1000;
    count.textContent = `${chosen.length} of ${rows.length} rows${chosen.length > most ? `, the first ${most} below` : ''}${best.size > 1 ? '; those of the front are marked' : ''}. A click on a column sorts by it.`;
    tablePlace.replaceChildren(element('table', {},
      element('tr', {}, ...columns.map((name, c) => element('th', {class: numeric[c] ? 'number' : '', onclick: () => { state.down = state.sort === c && !state.down; state.sort = c; draw(); }},
        name + (state.sort === c ? (state.down ? ' ▾' : ' ▴') : '')))),
      ...sorted.slice(0, most).map(r => element('tr', {class: best.has(r) ? 'front' : ''}, ...r.map((v, c) => element('td', {class: numeric[c] ? 'number' : ''}, v))))));
  };
  for (const axis of ['x', 'y']) boxes[axis].addEventListener('change', draw);
  // Where nothing is left, what was chosen last counts alone.
  const choose = (c, v) => {
    state.filters.set(c, v);
    if (!rows.some(fits)) {
      state.filters = new Map([[c, v]]);
      filters.querySelectorAll('select').forEach((select, k) => { select.value = state.filters.get(choices[k]) ?? ''; });
    }
    draw();
  };
  const controls = element('div', {class: 'controls'});
  if (numbers.length >= 2) {
    controls.append(
      picker('across', named(numbers), state.x, v => { state.x = Number(v); draw(); }), element('label', {}, boxes.x, ' log'),
      picker('up', named(numbers), state.y, v => { state.y = Number(v); draw(); }), element('label', {}, boxes.y, ' log'),
      picker('colours', [[-1, 'none'], ...named(choices)], state.group, v => { state.group = Number(v); draw(); }));
  } else {
    state.x = state.y = undefined;
  }
  const filters = element('div', {class: 'controls'}, ...choices.map(c => picker(columns[c], [['', 'all'], ...distinct[c].map(v => [v, v === '' ? '–' : v])], state.filters.get(c) ?? '', v => choose(c, v))));
  section.append(element('h2', {}, table.name), facts(table.facts), controls, filters, chartPlace, count, tablePlace);
  document.getElementById('tables').append(section);
  draw();
}

data.tables.forEach(addTable);
document.body.dataset.state = 'drawn';
document.body.dataset.circles = document.querySelectorAll('circle').length;
