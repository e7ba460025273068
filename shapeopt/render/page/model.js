// The network, its gradient and the family of bodies; independent of the document.
function makeModel(data) {
  const { layers, trends: [trend], reach, low, high, bounds, modes, reynolds, ratios, dimension } = data;
  const width = bounds.map(([a, b]) => b - a);
  const span = high.map((b, k) => b - low[k] || 1); // 1 where the scene has one Reynolds number

  // The quadratic trend of the scaled inputs z and its gradient; coefficients of 1, z, z_i z_j (j >= i).
  function quadratic(z) {
    const count = z.length;
    let [value, place] = [trend[0], count + 1];
    const slopes = trend.slice(1, count + 1);
    z.forEach((x, i) => (value += trend[1 + i] * x));
    for (let i = 0; i < count; i++) {
      for (let j = i; j < count; j++, place++) {
        value += trend[place] * z[i] * z[j];
        slopes[i] += trend[place] * z[j];
        slopes[j] += trend[place] * z[i];
      }
    }
    return { value, slopes };
  }

  // Cd and its gradient in the shape parameters, by backpropagation.
  function drag(parameters, re) {
    const inputs = [...parameters.map((x, k) => (k < ratios ? Math.log(x) : x)), Math.log(re)];
    const trace = [inputs.map((x, k) => (2 * (x - low[k])) / span[k] - 1)];
    for (let k = 0; k < layers.length - 1; k++) {
      trace.push(affine(layers[k], trace[k]).map(Math.tanh));
    }
    const last = layers[layers.length - 1];
    const output = dot(last.weight[0], trace[trace.length - 1]) + last.bias[0];
    let back = last.weight[0];
    for (let k = layers.length - 2; k >= 0; k--) {
      const slope = trace[k + 1].map((y, i) => (1 - y * y) * back[i]);
      back = trace[k].map((_, j) => slope.reduce((sum, s, i) => sum + s * layers[k].weight[i][j], 0));
    }
    const { value, slopes } = quadratic(trace[0]);
    const cd = Math.exp(value + reach * output);
    const chain = (x, k) => (k < ratios ? 1 / x : 1); // inputs are logarithms of the ratios
    return {
      cd,
      gradient: parameters.map((x, k) => {
        return (cd * (slopes[k] + reach * back[k]) * chain(x, k) * 2) / span[k];
      }),
    };
  }

  const affine = ({ weight, bias }, x) => weight.map((row, i) => dot(row, x) + bias[i]);
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

  // sin kt / sin t of every mode at stations t from nose to tail, by Chebyshev's recurrence.
  const waves = Array.from({ length: 181 }, (_, n) => {
    const c = Math.cos((Math.PI * n) / 180);
    const ratios = [1, 2 * c];
    for (let k = 2; k < Math.max(...modes); k++) ratios.push(2 * c * ratios[k - 1] - ratios[k - 2]);
    return modes.map((k) => ratios[k - 1]);
  });

  // The least ratio of thickness to the ellipse's, y / (b sin t), and the modes' values there.
  function thinnest(parameters) {
    const betas = parameters.slice(ratios);
    let [opening, place] = [Infinity, waves[0]];
    for (const wave of waves) {
      const here = 1 + dot(wave, betas);
      if (here < opening) [opening, place] = [here, wave];
    }
    return { opening, place };
  }

  const opening = (parameters) => thinnest(parameters).opening;
  const valid = (parameters) => opening(parameters) >= data.leastOpening;

  // sin t + beta2 sin 2t + ...
  const radius = (betas, t) =>
    betas.reduce((sum, beta, k) => sum + beta * Math.sin(modes[k] * t), Math.sin(t));

  // 3-D: half length, width and height for volume pi/6, and cos t of the centroid.
  function solid(parameters) {
    const betas = parameters.slice(ratios);
    let [bulk, moment] = [0, 0];
    waves.forEach((wave, n) => {
      const t = (Math.PI * n) / 180;
      const slice = Math.sin(t) ** 3 * (1 + dot(wave, betas)) ** 2;
      bulk += slice;
      moment += slice * Math.cos(t);
    });
    const thickness = (parameters[0] * 0.75 * bulk * (Math.PI / 180)) ** (-1 / 3);
    const root = Math.sqrt(ratios > 1 ? parameters[1] : 1);
    return {
      length: (parameters[0] * thickness) / 2,
      width: (thickness * root) / 2,
      height: thickness / root / 2,
      centre: moment / bulk,
    };
  }

  // 3-D: points of the surface and outward normals, at t from nose to tail and azimuth phi.
  function skin(parameters) {
    const [betas, { length, width, height, centre }] = [parameters.slice(ratios), solid(parameters)];
    return (t, phi) => {
      const [r, sine, cosine] = [radius(betas, t), Math.sin(phi), Math.cos(phi)];
      const slope = betas.reduce((s, b, k) => s + b * modes[k] * Math.cos(modes[k] * t), Math.cos(t));
      const point = [-length * (Math.cos(t) - centre), width * r * cosine, height * r * sine];
      const across = [length * height * Math.sin(t) * cosine, length * width * Math.sin(t) * sine];
      return { point, normal: [-width * height * slope, ...across] };
    };
  }

  // Contour, clockwise from the nose, centroid at the origin; 3-D: seen from the side.
  function contour(parameters, nodes) {
    const [[aspect], betas] = [parameters, parameters.slice(ratios)];
    const angles = Array.from({ length: nodes }, (_, n) => (2 * Math.PI * n) / nodes);
    if (dimension === 3) {
      const { length, height, centre } = solid(parameters);
      return angles.map((t) => [-length * (Math.cos(t) - centre), height * radius(betas, t)]);
    }
    const points = angles.map((t) => [
      (-Math.sqrt(aspect) / 2) * Math.cos(t),
      radius(betas, t) / (2 * Math.sqrt(aspect)),
    ]);
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

  // Project onto the ranges and, alternately, onto the bodies that are thick enough.
  function nearest(parameters) {
    let body = within(parameters);
    for (let n = 0; n < 40; n++) {
      const { opening, place } = thinnest(body);
      if (opening >= data.roomy) break;
      const slope = place.map((wave, k) => wave * width[k + ratios]);
      const stride = (data.roomy + 1e-4 - opening) / dot(slope, slope);
      const moved = (x, k) => (k < ratios ? x : x + stride * slope[k - ratios] * width[k]);
      body = within(body.map(moved));
    }
    return body;
  }

  const roomy = (parameters) => opening(parameters) >= data.roomy;

  // Projected gradient descent on log Cd in parameters scaled to [0, 1], with an adaptive step.
  function descend(start, re, iterations = 600) {
    let here = start;
    let { cd, gradient } = drag(here, re);
    let step = 0.1;
    for (let n = 0; n < iterations && step > 1e-10; n++) {
      const trial = nearest(here.map((x, k) => x - (step * gradient[k] * width[k] ** 2) / cd));
      const found = drag(trial, re);
      if (found.cd < cd && roomy(trial)) {
        [here, { cd, gradient }, step] = [trial, found, step * 1.7];
      } else {
        step /= 2.3;
      }
    }
    return { parameters: here, cd };
  }

  // Starts: ellipses of all aspects, and a low-discrepancy sequence over the family (Roberts 2018).
  function starts(ellipses = 25, spreadOut = 600) {
    const [least, most] = bounds[0];
    let golden = 2;
    for (let n = 0; n < 40; n++) golden = (1 + golden) ** (1 / (bounds.length + 1));
    return [
      ...Array.from({ length: ellipses }, (_, n) =>
        bounds.map((_, k) => (k ? data.reference[k] : least + ((most - least) * n) / (ellipses - 1))),
      ),
      ...Array.from({ length: spreadOut }, (_, n) =>
        bounds.map(([a], k) => a + width[k] * ((0.5 + (n + 1) / golden ** (k + 1)) % 1)),
      ),
    ];
  }

  // The body of least drag: descent from the best of the starts and the given body.
  function leastDrag(current, re, kept = 5) {
    return [current, ...starts()]
      .map(nearest)
      .filter(roomy)
      .map((parameters) => ({ parameters, cd: drag(parameters, re).cd }))
      .sort((a, b) => a.cd - b.cd)
      .slice(0, kept)
      .map(({ parameters }) => descend(parameters, re))
      .reduce((best, found) => (found.cd < best.cd ? found : best), { parameters: current, cd: Infinity });
  }

  const { reference } = data;
  return {
    ...{ drag, opening, valid, contour, skin, within, leastDrag },
    ...{ reference, bounds, width, reynolds, dimension },
  };
}
