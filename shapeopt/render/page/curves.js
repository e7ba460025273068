// Charts: drag over the Reynolds number; of bodies with lift Cl and Cl / Cd over the incidence.

// Tick values: round numbers of a logarithmic axis, at most `room`; evenly spaced on a short axis.
const rounds = (marks) => [...Array(10).keys()].flatMap((e) => marks.map((m) => m * 10 ** (e - 4)));
function ticks(least, most, room) {
  const inside = (value) => value >= least * (1 - 1e-9) && value <= most * (1 + 1e-9);
  for (const marks of [[1, 2, 5], [1]]) {
    const found = rounds(marks).filter(inside);
    if (found.length > 2 && found.length <= room) return found;
  }
  return even(least, most, room);
}

// Tick values of a linear axis: at most seven multiples of a round number.
function even(least, most, room) {
  const [step = 1] = rounds([1, 2, 5]).filter((value) => most - least <= value * Math.min(room, 6));
  const all = Array.from({ length: 7 }, (_, n) => (Math.ceil(least / step - 1e-9) + n) * step);
  return all.filter((value) => value <= most + 1e-9 * step);
}

// The lines and numbers of both axes; places are by x and y in pixels.
const [TOP, BOTTOM, LEFT] = [8, 188, 44];
function axes([vertical, x], [horizontal, y], right) {
  const text = (value) => minus(String(Number(value.toPrecision(3))));
  const down = vertical.map(
    (tick) => `<path class="grid" d="M${x(tick)} ${TOP}V${BOTTOM}"/>
      <text x="${x(tick)}" y="${BOTTOM + 18}" text-anchor="middle">${text(tick)}</text>`,
  );
  const across = horizontal.map(
    (tick) => `<path class="grid" d="M${LEFT} ${y(tick)}H${right}"/>
      <text x="${LEFT - 8}" y="${y(tick) + 4}" text-anchor="end">${text(tick)}</text>`,
  );
  return down.join("") + across.join("");
}

// The chart's path through points; `x` and `y` place them.
const through = (points, x, y) =>
  "M" + points.map(([a, b]) => `${x(a).toFixed(1)} ${y(b).toFixed(1)}`).join("L");

function drawCurve(body, re, valid) {
  const [low, high] = model.reynolds.map(Math.log);
  element("curve").parentElement.hidden = low === high;
  if (low === high) return;
  const across = element("curve").clientWidth || 600;
  const right = across - 14;
  const values = Array.from({ length: 81 }, (_, k) => Math.exp(low + ((high - low) * k) / 80));
  const drag = (parameters, value) => Math.exp(model.outputs(parameters, value, false)[0].value);
  const curves = [model.reference, body].map((p) => values.map((value) => [value, drag(p, value)]));
  const shown = (valid ? curves.flat() : curves[0]).map(([, cd]) => Math.log10(cd));
  const [least, most] = [Math.min(...shown) - 0.05, Math.max(...shown) + 0.05];
  const x = (value) => LEFT + ((right - LEFT) * (Math.log(value) - low)) / (high - low);
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (Math.log10(value) - least)) / (most - least);
  const [vertical, horizontal] = [ticks(...model.reynolds, across / 45), ticks(10 ** least, 10 ** most, 9)];
  const own = valid
    ? `<path class="own" d="${through(curves[1], x, y)}"/>
      <circle r="6" cx="${x(re)}" cy="${y(drag(body, re))}"/>`
    : "";
  element("curve").setAttribute("viewBox", `0 0 ${across} 216`);
  element("curve").innerHTML = `${axes([vertical, x], [horizontal, y], right)}
    <path class="here" d="M${x(re)} ${TOP}V${BOTTOM}"/>
    <path class="other" d="${through(curves[0], x, y)}"/>${own}`;
}

// Cl and Cl / Cd over the incidence at one shape and Re, with the current and the best incidence.
function drawLift(body, re, valid) {
  const incidences = model.bounds[model.names.indexOf("incidence")];
  element("lift").hidden = !incidences;
  for (const part of ["cl-curve", "glide-curve", "best-glide"]) element(part).replaceChildren();
  if (!incidences || !valid) return;
  const [here, most] = [model.incidenceOf(body), model.glideIncidence(body, re)];
  const at = (incidence) => {
    const [drag, lift] = model.loads(model.turned(body, incidence), re, false);
    return { cl: lift.value, glide: lift.value / drag.value };
  };
  const values = Array.from({ length: 81 }, (_, k) => incidences[0] + ((incidences[1] - incidences[0]) * k) / 80);
  const found = values.map((value) => [value, at(value)]);
  for (const name of ["cl", "glide"]) {
    const points = found.map(([value, loads]) => [value, loads[name]]);
    drawPanel(element(`${name}-curve`), points, [here, at(here)[name]], [most, at(most)[name]]);
  }
  element("best-glide").textContent =
    `${minus(at(most).glide.toFixed(3))} at ${minus(most.toFixed(1))}\u00b0`;
}

function drawPanel(svg, points, here, best) {
  const across = svg.clientWidth || 400;
  const [right, [low], [high]] = [across - 14, points[0], points.at(-1)];
  const heights = [0, ...points.map(([, value]) => value)];
  const margin = 0.08 * (Math.max(...heights) - Math.min(...heights)) || 1;
  const [least, most] = [Math.min(...heights) - margin, Math.max(...heights) + margin];
  const x = (value) => LEFT + ((right - LEFT) * (value - low)) / (high - low);
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (value - least)) / (most - least);
  const lines = axes([even(low, high, across / 45), x], [even(least, most, 6), y], right);
  svg.setAttribute("viewBox", `0 0 ${across} 216`);
  svg.innerHTML = `${lines}<path class="zero" d="M${LEFT} ${y(0)}H${right}"/>
    <path class="here" d="M${x(here[0])} ${TOP}V${BOTTOM}"/>
    <path class="own" d="${through(points, x, y)}"/>
    <circle class="best" r="8" cx="${x(best[0])}" cy="${y(best[1])}"/>
    <circle r="5" cx="${x(here[0])}" cy="${y(here[1])}"/>`;
}
