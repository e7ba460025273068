// The network: log Cd, with lift also Cl / Cd and Cm / Cd, and their gradients in the parameters.
const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

function makeNetwork(data) {
  const { logs, scale, shift, mirror, constant, linear, quadratic, weights, biases } = data;
  // of 3-D bodies at incidence: their features, and the parts of their moment
  const { incidence, angle, sources, waves, inertial, stokes } = data;
  const PARITY = [1, -1, -1]; // of the mirror image: equal drag, opposite lift and moment

  // The features at scaled inputs, and the map from slopes in them to slopes in the inputs.
  function featuresOf(scaled) {
    if (incidence < 0) return { z: scaled, chain: (slopes) => slopes };
    const a = angle * scaled[incidence];
    const values = [1, Math.cos(a), Math.sin(a), Math.cos(2 * a), Math.sin(2 * a)];
    const steps = [0, -values[2], values[1], -2 * values[4], 2 * values[3]].map((x) => angle * x);
    const own = sources.map((k) => (k === incidence ? 1 : scaled[k]));
    const chain = (slopes) => {
      const found = scaled.map(() => 0);
      slopes.forEach((slope, j) => {
        if (sources[j] !== incidence) found[sources[j]] += slope * values[waves[j]];
        found[incidence] += slope * own[j] * steps[waves[j]];
      });
      return found;
    };
    return { z: own.map((x, j) => x * values[waves[j]]), chain };
  }

  // The quadratic trend of a load at features z, and its gradient.
  function trend(load, z) {
    const product = quadratic[load].map((row) => dot(row, z));
    return {
      value: constant[load] + dot(linear[load], z) + dot(product, z),
      slopes: linear[load].map((slope, i) => slope + 2 * product[i]),
    };
  }

  // Every layer's inputs, and the gradient of a weighted sum of the last ones, by backpropagation.
  function forward(z) {
    const trace = [z];
    for (let k = 0; k < weights.length - 1; k++) {
      const last = trace.at(-1);
      trace.push(weights[k].map((row, i) => Math.tanh(dot(row, last) + biases[k][i])));
    }
    return trace;
  }

  function backward(trace, row) {
    let back = row;
    for (let k = weights.length - 2; k >= 0; k--) {
      const slope = trace[k + 1].map((y, i) => (1 - y * y) * back[i]);
      back = trace[k].map((_, j) => slope.reduce((sum, s, i) => sum + s * weights[k][i][j], 0));
    }
    return back;
  }

  // The outputs at features before they are made even or odd, and if asked for their gradients.
  function unsymmetric(z, sloped) {
    const trace = forward(z);
    const heads = weights.at(-1).map((row, head) => {
      const own = trend(head, z);
      const value = own.value + dot(row, trace.at(-1)) + biases.at(-1)[head];
      if (!sloped) return { value, slopes: [] };
      const back = backward(trace, row);
      return { value, slopes: own.slopes.map((slope, i) => slope + back[i]) };
    });
    return inertial ? [...heads.slice(0, 2), momentOf(heads.slice(2), z)] : heads;
  }

  // The moment of a 3-D body at incidence: by inertia, and that of Stokes flow.
  function momentOf(heads, z) {
    const step = scale.at(-1), last = z.length - 1;
    const share = 1 / (1 + inertial * Math.exp((shift.at(-1) - z[last]) / step));
    const factors = [share, ...stokes.map((k) => z[k])];
    const steps = [share * (1 - share) / step, ...stokes.map(() => 1)];
    const slopes = heads[0].slopes.map((_, i) => dot(factors, heads.map((head) => head.slopes[i])));
    if (slopes.length) [last, ...stokes].forEach((k, j) => (slopes[k] += steps[j] * heads[j].value));
    return { value: dot(factors, heads.map((head) => head.value)), slopes };
  }

  // Log Cd is even and the others odd where a body changes to its mirror image.
  function symmetric(z, sloped) {
    const own = unsymmetric(z, sloped);
    if (own.length === 1) return own;
    const image = unsymmetric(z.map((x, i) => mirror[i] * x), sloped);
    return own.map(({ value, slopes }, k) => ({
      value: (value + PARITY[k] * image[k].value) / 2,
      slopes: slopes.map((slope, i) => (slope + PARITY[k] * mirror[i] * image[k].slopes[i]) / 2),
    }));
  }

  // Log Cd (, Cl / Cd, Cm / Cd), each with its gradient in the shape parameters if asked for.
  function outputs(parameters, re, sloped = true) {
    const inputs = [...parameters, re];
    const chain = parameters.map((x, k) => scale[k] / (logs[k] ? x : 1));
    const scaled = inputs.map((x, k) => scale[k] * (logs[k] ? Math.log(x) : x) + shift[k]);
    const features = featuresOf(scaled);
    return symmetric(features.z, sloped).map(({ value, slopes }) => {
      const each = features.chain(slopes).slice(0, chain.length);
      return { value, gradient: each.map((slope, k) => slope * chain[k]) };
    });
  }

  // Cd (, Cl, Cm), each with its gradient in the shape parameters if asked for.
  function loads(parameters, re, sloped = true) {
    const [drag, ...others] = outputs(parameters, re, sloped);
    const cd = Math.exp(drag.value);
    return [
      { value: cd, gradient: drag.gradient.map((slope) => cd * slope) },
      ...others.map(({ value, gradient }) => ({
        value: cd * value,
        gradient: gradient.map((slope, k) => cd * (slope + value * drag.gradient[k])),
      })),
    ];
  }

  return { outputs, loads, lifting: constant.length > 1 };
}
