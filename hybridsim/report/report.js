"use strict";
// This script draws the curves, modes, phase plots and events of a report from the JSON in the element #data.
const $ = id => document.getElementById(id), all = selector => [...document.querySelectorAll(selector)];
const data = JSON.parse($("data").textContent), { t0, t1 } = data, span = t1 - t0, unit = data.unit ? ` ${data.unit}` : "";
const LEFT = 58, RIGHT = 10, CURVE = 104, STRIP = 24, AXIS = 22, ROW = 28; // pixels
const MOST_MARKS = 150, VISIBLE = 1e-3; // lines at events; the smallest jump that is drawn, as part of the range
const TYPES = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
const unpack = packed => {
  if (!packed) return null;
  const text = atob(packed.bytes), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new TYPES[packed.kind](bytes.buffer);
};
const make = (tag, parent, text = "", properties = {}) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.textContent = text;
  parent.append(element);
  return element;
};
const above = (sorted, value) => { // the index of the first entry above a value
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
};
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const number = (value, digits = 6) => String(Number(value.toPrecision(digits))).replace(/-/g, "−");

const { quantities, parts, low, high } = data.curves ? {
  quantities: data.curves.quantities.map((quantity, index) => ({ ...quantity, index, scale: 10 ** quantity.power })),
  parts: data.curves.parts.map(part => ({ t: unpack(part.t), values: part.values.map(unpack) })),
  low: data.curves.ranges && data.curves.ranges.low.map(unpack),
  high: data.curves.ranges && data.curves.ranges.high.map(unpack),
} : { quantities: [], parts: [] };
const components = data.modes.map(one => ({ ...one, starts: unpack(one.starts), mode: unpack(one.mode) }));
const events = data.events && {
  ...data.events, t: unpack(data.events.t), change: unpack(data.events.change),
  states: data.events.states && data.events.states.map(one => ({ before: unpack(one.before), after: unpack(one.after) })),
};

// Drawing
const view = { a: t0, b: t1 };
const theme = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const colourOf = (component, mode) => component.colours[mode] || theme("ink");
const xOf = (t, width) => LEFT + (t - view.a) / (view.b - view.a) * (width - LEFT - RIGHT);
const timeText = t => {
  const digits = Math.ceil(Math.log10(Math.max(Math.abs(t), view.b - view.a) / (view.b - view.a))) + 5;
  return number(t, clamp(digits, 6, 15));
};
const prepared = (canvas, height) => {
  const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1, context = canvas.getContext("2d");
  canvas.style.height = `${height}px`;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  Object.assign(context, { font: "11.5px system-ui, sans-serif", textBaseline: "middle", lineJoin: "round", lineCap: "round" });
  return { context, width, height };
};
const stroke = (context, points) => {
  context.beginPath();
  points.forEach(([x, y], i) => i ? context.lineTo(x, y) : context.moveTo(x, y));
  context.stroke();
};
const ticks = (from, to, count) => { // round values, each with its text
  const rough = (to - from) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough)), found = [];
  const step = [1, 2, 5, 10].find(factor => factor * power >= rough * (1 - 1e-9)) * power;
  const decimals = clamp(-Math.floor(Math.log10(step) + 1e-9), 0, 12);
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step && found.length < 50; k++) {
    const text = Math.abs(k * step) >= 1e6 ? number(k * step, 8) : (k === 0 ? 0 : k * step).toFixed(decimals);
    found.push([k * step, text.replace("-", "−")]);
  }
  return found;
};
// Points of a quantity in the view. If there are more points than pixels, each column of pixels has its first, least,
// largest and last value. Jumps at events are apart. Bars are the ranges of bins whose points are not in the page.
const trace = (q, columns) => {
  const found = { lines: [], jumps: [], bars: [], low: Infinity, high: -Infinity };
  const visible = VISIBLE * (quantities[q].high - quantities[q].low), scale = columns / (view.b - view.a);
  const extend = (least, most) => { found.low = Math.min(found.low, least); found.high = Math.max(found.high, most); };
  for (const { t, values } of parts) {
    const v = values[q], last = Math.min(above(t, view.b) + 1, t.length);
    let i = Math.max(above(t, view.a) - 2, 0), line = [], column = -1, least = 0, most = 0;
    const isDense = last - i > 4 * columns, first = i;
    if (!t.length || t[0] > view.b || t[t.length - 1] < view.a) continue;
    for (; i < last; i++) {
      const value = v[i], own = Math.floor((t[i] - view.a) * scale);
      if (!Number.isFinite(value)) { found.lines.push(line); line = []; continue; }
      if (t[i] >= view.a && t[i] <= view.b) extend(value, value);
      if (isDense && own === column && i < last - 1) {
        [least, most] = [Math.min(least, value), Math.max(most, value)];
        continue;
      }
      if (isDense && column >= 0) line.push([t[i - 1], least], [t[i - 1], most], [t[i - 1], v[i - 1]]);
      if (!isDense && i > first && t[i] === t[i - 1] && Math.abs(value - v[i - 1]) > visible) {
        found.jumps.push([t[i], v[i - 1], value]);
        found.lines.push(line);
        line = [];
      }
      line.push([t[i], value]);
      column = own;
      least = most = value;
    }
    found.lines.push(line);
  }
  const count = low ? low[q].length : 0, bin = span / count, until = Math.min(Math.ceil((view.b - t0) / bin), count);
  for (let k = Math.max(Math.floor((view.a - t0) / bin), 0); k < until; k++) {
    const start = t0 + k * bin, isWhole = parts.some(({ t }) => t[0] <= start && start + bin <= t[t.length - 1]);
    if (isWhole || !(Number.isFinite(low[q][k]) && Number.isFinite(high[q][k]))) continue;
    found.bars.push([start, start + bin, low[q][k], high[q][k]]);
    extend(low[q][k], high[q][k]);
  }
  if (found.low > found.high) found.low = found.high = 0;
  found.margin = (found.high - found.low) * 0.06 || Math.abs(found.high) * 0.1 || 1;
  return found;
};
const drawCurve = (canvas, quantity) => {
  const { context, width, height } = prepared(canvas, CURVE), { scale } = quantity;
  const found = trace(quantity.index, Math.max(width - LEFT - RIGHT, 10) * (window.devicePixelRatio || 1));
  const least = found.low - found.margin, most = found.high + found.margin;
  const x = t => xOf(t, width), y = value => height - 3 - (value - least) / (most - least) * (height - 6);
  Object.assign(context, { fillStyle: theme("weak"), strokeStyle: theme("grid"), textAlign: "right" });
  for (const [value, text] of ticks(least / scale, most / scale, 6)) {
    stroke(context, [[LEFT, y(value * scale)], [width - RIGHT, y(value * scale)]]);
    context.fillText(text, LEFT - 6, clamp(y(value * scale), 6, height - 6));
  }
  context.beginPath();
  context.rect(LEFT, 0, width - LEFT - RIGHT, height);
  context.clip();
  const marks = events ? events.t.subarray(above(events.t, view.a), above(events.t, view.b)) : [];
  context.strokeStyle = theme("line");
  if (marks.length <= MOST_MARKS) marks.forEach(t => stroke(context, [[x(t), 0], [x(t), height]]));
  context.strokeStyle = context.fillStyle = theme("accent");
  for (const [start, end, from, to] of found.bars) {
    context.globalAlpha = x(end) - x(start) > 3 ? 0.35 : 1;
    context.fillRect(x(start), y(to) - 0.6, Math.max(x(end) - x(start), 0.6), y(from) - y(to) + 1.2);
  }
  [context.globalAlpha, context.lineWidth] = [1, 1.4];
  for (const line of found.lines) stroke(context, line.map(([t, value]) => [x(t), y(value)]));
  context.setLineDash([3, 3]);
  for (const [t, before, after] of found.jumps) stroke(context, [[x(t), y(before)], [x(t), y(after)]]);
};
// An interval that is narrower than three pixels gets a column, in which several show the shares of their modes.
const drawStrip = (canvas, component) => {
  const { context, width } = prepared(canvas, STRIP), most = Math.max(Math.floor(width - LEFT - RIGHT), 1) - 1;
  const { starts, mode } = component, columns = new Map(), high = STRIP - 4;
  const x = t => clamp(xOf(t, width) - LEFT, 0, most + 1), columnOf = at => Math.min(Math.floor(at), most);
  const bar = (from, wide, low, tall, k) => Object.assign(context, { fillStyle: colourOf(component, k) })
    .fillRect(LEFT + from, 2 + (1 - low - tall) * high, wide, tall * high);
  for (let i = Math.max(above(starts, view.a) - 1, 0); i < starts.length && starts[i] <= view.b; i++) {
    const a = x(starts[i]), b = x(i + 1 < starts.length ? starts[i + 1] : t1), step = b - a < 3 ? 1 : columnOf(b) - columnOf(a);
    bar(a, b - a, 0, 1, mode[i]);
    for (let k = columnOf(a); k <= columnOf(b) && b > a; k += step) {
      const column = columns.get(k) || columns.set(k, { shares: [], narrow: [] }).get(k);
      column.shares[mode[i]] = (column.shares[mode[i]] || 0) + Math.min(b, k + 1) - Math.max(a, k);
      if (b - a < 3) column.narrow.push(k === columnOf((a + b) / 2) ? mode[i] : -1);
    }
  }
  columns.forEach(({ shares, narrow }, k) => {
    const tall = shares.map((share, j) => narrow.length > 1 || j === narrow[0] ? Math.max(share, 1 / high) : 0);
    const sum = tall.reduce((total, one) => total + one, 0);
    if (sum) tall.reduce((low, one, j) => (bar(k, 1, low, one / sum, j), low + one / sum), 0);
  });
};
const drawAxis = canvas => {
  const { context, width } = prepared(canvas, AXIS);
  context.fillStyle = theme("weak");
  context.fillText(data.unit ? `t [${data.unit}]` : "t", 4, 13);
  context.textAlign = "center";
  for (const [t, text] of ticks(view.a, view.b, Math.max(Math.floor((width - LEFT) / 90), 2))) {
    const half = context.measureText(text).width / 2;
    context.fillText(text, clamp(xOf(t, width), LEFT, width - half), 13);
  }
};

// Time histories
const chart = $("chart"), rows = [], planes = [];
let cursor = null, drag = null, isWaiting = false;
const redraw = () => {
  if (isWaiting || !chart) return;
  isWaiting = true;
  requestAnimationFrame(() => {
    isWaiting = false;
    rows.filter(row => !row.box.hidden).forEach(row => row.draw());
    drawAxis($("axis"));
    planes.forEach(plane => plane.draw());
    $("note").hidden = !low || parts.some(({ t }) => t[0] <= view.a && view.b <= t[t.length - 1]);
    showCursor();
  });
};
const setView = (a, b) => {
  const wide = clamp(b - a, Math.max(span * 1e-9, 1e-13 * Math.max(Math.abs(t0), Math.abs(t1))), span);
  view.a = clamp((a + b - wide) / 2, t0, t1 - wide);
  view.b = wide === span ? t1 : view.a + wide;
  redraw();
};
const isSeen = () => cursor !== null && cursor >= view.a && cursor <= view.b;
const zoom = (factor, at = isSeen() ? cursor : (view.a + view.b) / 2) =>
  setView(at - (at - view.a) * factor, at + (view.b - at) * factor);
const shift = part => setView(view.a + part * (view.b - view.a), view.b + part * (view.b - view.a));
const moves = {
  left: () => shift(-0.2), right: () => shift(0.2), in: () => zoom(0.5), out: () => zoom(2), all: () => setView(t0, t1),
};
const valueAt = (q, t) => {
  const part = parts.find(one => one.t[0] <= t && t <= one.t[one.t.length - 1]);
  if (!part) return null;
  const k = clamp(above(part.t, t), 1, part.t.length - 1), [a, b] = [part.t[k - 1], part.t[k]], v = part.values[q];
  return b > a ? v[k - 1] + (v[k] - v[k - 1]) * (t - a) / (b - a) : v[k];
};
const valueText = ({ index, scale }, t) => {
  const value = valueAt(index, t), count = low ? low[index].length : 0;
  const k = clamp(Math.floor((t - t0) / span * count), 0, count - 1);
  return value === null ? `${number(low[index][k] / scale, 4)} to ${number(high[index][k] / scale, 4)}` : number(value / scale);
};
const modeText = ({ starts, mode, modes }, t) => modes[mode[Math.max(above(starts, t) - 1, 0)]];
const showCursor = () => {
  const range = `${timeText(view.a)} to ${timeText(view.b)}${unit}`;
  $("line").hidden = !isSeen();
  $("line").style.left = `${xOf(cursor, chart.clientWidth)}px`;
  $("range").textContent = !isSeen() ? range : `t = ${timeText(cursor)}${unit}, in ${range}`;
  for (const row of rows) row.value.textContent = cursor === null ? "" : row.text(cursor);
  planes.forEach(plane => plane.point());
};
const setCursor = (t, isSpoken = false) => {
  if (!chart) return;
  cursor = t === null ? null : clamp(t, t0, t1);
  showCursor();
  const texts = rows.filter(row => !row.box.hidden).map(row => `${row.box.dataset.name} ${row.value.textContent}`);
  if (isSpoken) $("spoken").textContent = [`t = ${timeText(cursor)}${unit}`, ...texts].join(", ");
};
const timeAt = event => {
  const width = chart.clientWidth, x = event.clientX - chart.getBoundingClientRect().left;
  return clamp(view.a + (x - LEFT) / (width - LEFT - RIGHT) * (view.b - view.a), view.a, view.b);
};
const connectChart = () => {
  for (const box of all("#chart > .curve, #chart > .strip")) {
    const canvas = box.querySelector("canvas"), value = box.querySelector("output"), k = Number(box.dataset.index);
    const [draw, text, one] = box.className === "curve" ? [drawCurve, valueText, quantities[k]] : [drawStrip, modeText, components[k]];
    rows.push({ box, value, draw: () => draw(canvas, one), text: t => text(one, t) });
  }
  all("#boxes input").forEach((input, k) => { input.onchange = () => { rows[k].box.hidden = !input.checked; redraw(); }; });
  for (const button of all("[data-move]")) button.onclick = moves[button.dataset.move];
  const names = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "in", "+": "in", ArrowDown: "out", "-": "out", Home: "all" };
  chart.onkeydown = event => {
    const name = names[event.key], step = { left: -1, right: 1 }[name];
    if (!name || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (!event.shiftKey || !step) moves[name]();
    else setCursor((isSeen() ? cursor : (view.a + view.b) / 2) + step * (view.b - view.a) / 100, true);
  };
  chart.onpointerdown = event => { if (event.button === 0) { drag = timeAt(event); chart.setPointerCapture(event.pointerId); } };
  chart.onpointermove = event => {
    setCursor(timeAt(event));
    const [a, b] = [drag === null ? cursor : drag, cursor].map(t => xOf(t, chart.clientWidth)).sort((x, y) => x - y);
    $("drag").hidden = drag === null;
    Object.assign($("drag").style, { left: `${a}px`, width: `${b - a}px` });
  };
  chart.onpointerup = chart.onpointercancel = event => {
    const [a, b] = [drag, timeAt(event)].sort((x, y) => x - y), isZoom = event.type === "pointerup" && drag !== null;
    [drag, $("drag").hidden] = [null, true];
    if (isZoom && b - a > (view.b - view.a) * 0.01) setView(a, b);
  };
  chart.onpointerleave = () => { if (drag === null) setCursor(null); };
  chart.ondblclick = moves.all;
  new ResizeObserver(redraw).observe(chart);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
};

// One quantity over another
const drawPlane = (canvas, pair, component) => {
  const { context, width, height } = prepared(canvas, clamp(canvas.clientWidth * 0.62, 220, 340)), base = height - 24;
  const ranges = pair.map(q => trace(q.index, width)).map(found => [found.low - found.margin, found.high + found.margin]);
  const part = (i, value) => (value - ranges[i][0]) / (ranges[i][1] - ranges[i][0]);
  const x = value => LEFT + part(0, value) * (width - LEFT - RIGHT), y = value => base - part(1, value) * (base - 6);
  const sizes = pair.map(q => VISIBLE * (q.high - q.low)), paths = new Map();
  [context.strokeStyle, context.fillStyle] = [theme("grid"), theme("weak")];
  pair.forEach(({ scale }, i) => {
    const [from, to] = ranges[i].map(value => value / scale);
    context.textAlign = i ? "right" : "center";
    for (const [value, text] of ticks(from, to, i ? 5 : Math.max((width - LEFT) / 80, 2))) {
      const at = (i ? y : x)(value * scale);
      stroke(context, i ? [[LEFT, at], [width - RIGHT, at]] : [[at, 6], [at, base]]);
      context.fillText(text, i ? LEFT - 6 : Math.min(at, width - 14), i ? at : base + 13);
    }
  });
  const pathOf = key => paths.get(key) || paths.set(key, new Path2D()).get(key);
  for (const { t, values } of parts) {
    const [v, w] = pair.map(q => values[q.index]), last = Math.min(above(t, view.b) + 1, t.length);
    let i = Math.max(above(t, view.a) - 1, 0), before = null, k = component ? above(component.starts, t[i]) - 1 : 0;
    for (let own; i < last; before = own, i++) {
      const isAfter = i > 0 && t[i] === t[i - 1], starts = component ? component.starts : [];
      while (k + 1 < starts.length && (starts[k + 1] < t[i] || (isAfter && starts[k + 1] === t[i]))) k++;
      own = !Number.isFinite(v[i] + w[i]) ? null : component ? component.mode[Math.max(k, 0)] : -1;
      if (own === null) continue;
      const isJump = isAfter && [v, w].some((values, j) => Math.abs(values[i] - values[i - 1]) > sizes[j]);
      if (isJump && before !== null) {
        pathOf("jump").moveTo(x(v[i - 1]), y(w[i - 1]));
        pathOf("jump").lineTo(x(v[i]), y(w[i]));
      }
      if (before !== own || isJump) pathOf(own).moveTo(x(v[i]), y(w[i]));
      pathOf(own).lineTo(x(v[i]), y(w[i]));
    }
  }
  for (const [mode, path] of paths) {
    const isJump = mode === "jump";
    context.strokeStyle = isJump ? theme("weak") : component ? colourOf(component, mode) : theme("accent");
    context.lineWidth = isJump ? 0.8 : component && mode === component.held ? 3 : 1.4;
    context.setLineDash(isJump ? [3, 3] : []);
    context.stroke(path);
  }
  return { x, y };
};
const connectPlane = box => {
  const [canvas, dot] = [box.querySelector("canvas"), box.querySelector("i")], selects = [...box.querySelectorAll("select")];
  const component = components[box.dataset.component], pair = () => selects.map(one => quantities[one.value]).reverse();
  let at = null;
  planes.push({
    draw: () => { at = drawPlane(canvas, pair(), component); },
    point: () => {
      const [v, w] = isSeen() && at ? pair().map(q => valueAt(q.index, cursor)) : [null, null];
      dot.hidden = v === null || w === null;
      if (!dot.hidden) Object.assign(dot.style, { left: `${at.x(v)}px`, top: `${canvas.offsetTop + at.y(w)}px` });
    },
  });
  selects.forEach(select => { select.onchange = redraw; });
};

// Events
let listed = [], chosen = -1;
const numberOf = k => events.omitted && k >= events.t.length / 2 ? k + events.omitted : k;
const drawRows = () => {
  const first = Math.max(Math.floor($("rows").scrollTop / ROW) - 2, 0), inner = $("inner");
  const last = Math.min(first + Math.ceil($("rows").clientHeight / ROW) + 5, listed.length);
  inner.replaceChildren();
  for (let i = first; i < last; i++) {
    const k = listed[i], row = make("div", inner, "", { className: "row", id: `row-${k}`, onclick: () => choose(i) });
    const attributes = { role: "option", "aria-selected": i === chosen, "aria-posinset": i + 1, "aria-setsize": listed.length };
    for (const [name, value] of Object.entries(attributes)) row.setAttribute(name, value);
    row.style.top = `${i * ROW}px`;
    for (const text of [numberOf(k), number(events.t[k], 9), events.texts[events.change[k]], events.reasons[numberOf(k)] || ""])
      make("span", row, text);
  }
};
const choose = i => {
  if (!listed.length) return;
  chosen = clamp(i, 0, listed.length - 1);
  const box = $("rows"), top = chosen * ROW, k = listed[chosen];
  box.scrollTop = clamp(box.scrollTop, top + ROW - box.clientHeight, top);
  drawRows();
  box.setAttribute("aria-activedescendant", `row-${k}`);
  describe(k);
  setCursor(events.t[k]);
};
const describe = k => {
  const box = $("event"), change = events.change[k], n = numberOf(k);
  const like = events.change.findIndex((one, i) => one === change && events.reasons[numberOf(i)]);
  box.replaceChildren();
  make("p", box, `Event ${n} at t = ${events.t[k]}${unit}: ${events.details[change]}`);
  if (events.reasons[n]) make("p", box, events.reasons[n]);
  else if (like >= 0) make("p", box, `In Python, sol.explain(${n}) prints the reason. This is the reason of event `
    + `${numberOf(like)}, which is the same change: ${events.reasons[numberOf(like)]}`);
  const table = make("table", box), head = make("tr", table);
  for (const text of events.states ? ["state", "just before", "just after"] : []) make("th", head, text, { scope: "col" });
  (events.states || []).forEach(({ before, after }, i) => {
    const row = make("tr", table);
    make("th", row, data.states[i], { scope: "row" });
    for (const values of [before, after || before]) make("td", row, number(values[k]));
  });
  if (chart) make("button", box, "Show in the curves", { type: "button", onclick: showChosen });
};
const showChosen = () => {
  if (chosen < 0 || !chart) return;
  const { t } = events, k = listed[chosen], around = t[Math.min(k + 8, t.length - 1)] - t[Math.max(k - 8, 0)] || span;
  setView(t[k] - around / 2, t[k] + around / 2);
  setCursor(t[k], true);
  $("histories").scrollIntoView({ block: "start" });
};
const list = () => {
  const own = $("filter").value;
  listed = Array.from(events.t.keys()).filter(k => own === "" || events.change[k] === Number(own));
  [chosen, $("inner").style.height, $("rows").scrollTop] = [-1, `${listed.length * ROW}px`, 0];
  $("count").textContent = `${listed.length} of ${events.count}`;
  drawRows();
};
const connectEvents = () => {
  $("filter").onchange = list;
  $("number").onchange = () => choose(above(listed.map(numberOf), Number($("number").value) - 1));
  $("rows").onscroll = drawRows;
  $("rows").onkeydown = event => {
    const page = Math.floor($("rows").clientHeight / ROW), steps = { ArrowUp: -1, ArrowDown: 1, PageUp: -page, PageDown: page };
    const to = { Home: 0, End: listed.length }[event.key] ?? chosen + steps[event.key];
    if (event.key === "Enter") showChosen(); else if (Number.isNaN(to)) return; else choose(to);
    event.preventDefault();
  };
  list();
};

if (chart) connectChart();
all(".picture").forEach(connectPlane);
if (events) connectEvents();
