// The surrogate, its shape gradient and the family of bodies, in plain numbers: no document here.
function makeModel(data) {
  const { layers, low, high, size, mean, spread, bounds, reynolds, leastOpening } = data;
  const width = bounds.map(([a, b]) => b - a);

  // size[0] x^2 + size[1] x + size[2], as numpy's polyval.
  const polyval = (coefficients, x) => coefficients.reduce((sum, c) => sum * x + c, 0);

  // Cd and its gradient in the shape parameters: one pass forward, one back.
  function drag(parameters, re) {
    const logRe = Math.log(re);
    const inputs = [...parameters, logRe];
    const trace = [inputs.map((x, k) => (2 * (x - low[k])) / (high[k] - low[k]) - 1)];
    for (let k = 0; k < layers.length - 1; k++) {
      trace.push(affine(layers[k], trace[k]).map(Math.tanh));
    }
    const last = layers[layers.length - 1];
    const output = dot(last.weight[0], trace[trace.length - 1]) + last.bias[0];
    const scale = Math.exp(polyval(size, logRe));
    let back = last.weight[0];
    for (let k = layers.length - 2; k >= 0; k--) {
      const slope = trace[k + 1].map((y, i) => (1 - y * y) * back[i]);
      back = trace[k].map((_, j) => slope.reduce((sum, s, i) => sum + s * layers[k].weight[i][j], 0));
    }
    const factor = -2 * scale * spread[0];
    return {
      cd: -2 * scale * (mean[0] + spread[0] * output),
      gradient: parameters.map((_, k) => (factor * back[k] * 2) / (high[k] - low[k])),
    };
  }

  const affine = ({ weight, bias }, x) => weight.map((row, i) => dot(row, x) + bias[i]);
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

  // Least y / (b sin t); sin kt / sin t by the Chebyshev recurrence in cos t.
  function opening([, ...betas]) {
    let least = Infinity;
    for (let n = 0; n <= 180; n++) {
      const c = Math.cos((Math.PI * n) / 180);
      let [before, now, sum] = [1, 2 * c, 1];
      for (const beta of betas) {
        sum += beta * now;
        [before, now] = [now, 2 * c * now - before];
      }
      least = Math.min(least, sum);
    }
    return least;
  }

  const valid = (parameters) => opening(parameters) >= leastOpening;

  // Contour, clockwise from the nose, area centroid at the origin.
  function contour([aspect, ...betas], nodes) {
    const points = Array.from({ length: nodes }, (_, n) => {
      const t = (2 * Math.PI * n) / nodes;
      const y = betas.reduce((sum, beta, k) => sum + beta * Math.sin((k + 2) * t), Math.sin(t));
      return [(-Math.sqrt(aspect) / 2) * Math.cos(t), y / (2 * Math.sqrt(aspect))];
    });
    let [area, moment] = [0, 0];
    points.forEach(([x, y], n) => {
      const [x1, y1] = points[(n + 1) % nodes];
      const cross = y * x1 - x * y1;
      area += cross / 2;
      moment += ((x + x1) * cross) / 6;
    });
    return points.map(([x, y]) => [x - moment / area, y]);
  }

  const within = (parameters) =>
    parameters.map((x, k) => Math.min(Math.max(x, bounds[k][0]), bounds[k][1]));

  // Projected gradient descent on log Cd in parameters scaled to [0, 1], the step grown and halved.
  function descend(start, re, iterations = 600) {
    let here = start;
    let { cd, gradient } = drag(here, re);
    let step = 0.1;
    for (let n = 0; n < iterations && step > 1e-10; n++) {
      const trial = within(here.map((x, k) => x - (step * gradient[k] * width[k] ** 2) / cd));
      const found = drag(trial, re);
      if (found.cd < cd && opening(trial) >= 2 * leastOpening) {
        [here, { cd, gradient }, step] = [trial, found, step * 1.7];
      } else {
        step /= 2.3;
      }
    }
    return { parameters: here, cd };
  }

  // The best of a coarse grid of bodies, and of the given one, polished by descent.
  function leastDrag(current, re, kept = 5) {
    let grid = [[]];
    for (const [a, b] of bounds) {
      grid = grid.flatMap((head) => [0, 0.25, 0.5, 0.75, 1].map((s) => [...head, a + s * (b - a)]));
    }
    const ranked = [current, ...grid]
      .filter((parameters) => opening(parameters) >= 2 * leastOpening)
      .map((parameters) => ({ parameters, cd: drag(parameters, re).cd }))
      .sort((a, b) => a.cd - b.cd)
      .slice(0, kept);
    return ranked
      .map(({ parameters }) => descend(parameters, re))
      .reduce((best, found) => (found.cd < best.cd ? found : best));
  }

  const cylinder = [1, ...width.slice(1).map(() => 0)];
  return { drag, opening, valid, contour, within, leastDrag, cylinder, bounds, width, reynolds };
}
