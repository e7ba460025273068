// The family of bodies: which of them are valid, and their contours.
function makeFamily(data) {
  const { names, bounds, modes, camberModes, ratios, dimension } = data;
  const width = bounds.map(([a, b]) => b - a);
  const betasOf = (parameters) => parameters.slice(ratios, ratios + modes.length);
  const gammasOf = (parameters) => parameters.slice(ratios + modes.length).slice(0, camberModes.length);
  const incidenceOf = (parameters) => parameters[names.indexOf("incidence")] || 0;

  // sin kt / sin t of every mode at stations t from nose to tail, by Chebyshev's recurrence.
  const waves = Array.from({ length: 181 }, (_, n) => {
    const c = Math.cos((Math.PI * n) / 180);
    const found = [1, 2 * c];
    for (let k = 2; k < Math.max(...modes); k++) found.push(2 * c * found[k - 1] - found[k - 2]);
    return modes.map((k) => found[k - 1]);
  });

  // The least ratio of thickness to the ellipse's, y / (b sin t), and the modes' values there.
  function thinnest(parameters) {
    const betas = betasOf(parameters);
    let [ratio, place] = [Infinity, waves[0]];
    for (const wave of waves) {
      const here = 1 + dot(wave, betas);
      if (here < ratio) [ratio, place] = [here, wave];
    }
    return { ratio, place };
  }

  const thicknessRatio = (parameters) => thinnest(parameters).ratio;
  const valid = (parameters) => thicknessRatio(parameters) >= data.leastThicknessRatio;
  const clear = (parameters) => thicknessRatio(parameters) >= data.clearThicknessRatio;

  const within = (parameters) =>
    parameters.map((x, k) => Math.min(Math.max(x, bounds[k][0]), bounds[k][1]));

  // Project onto the ranges and, alternately, onto the bodies that are thick enough.
  function nearest(parameters) {
    let body = within(parameters);
    for (let n = 0; n < 40; n++) {
      const { ratio, place } = thinnest(body);
      if (ratio >= data.clearThicknessRatio) break;
      const slope = place.map((wave, k) => wave * width[k + ratios]);
      const stride = (data.clearThicknessRatio + 1e-4 - ratio) / dot(slope, slope);
      const share = (k) => slope[k - ratios] || 0; // of the sine modes only
      body = within(body.map((x, k) => x + stride * share(k) * width[k]));
    }
    return body;
  }

  // sin t + beta2 sin 2t + ...
  const radius = (betas, t) =>
    betas.reduce((sum, beta, k) => sum + beta * Math.sin(modes[k] * t), Math.sin(t));

  // -gamma2 cos 2t - ..., the camber line over the half thickness of the ellipse.
  const camber = (gammas, t) =>
    gammas.reduce((sum, gamma, k) => sum - gamma * Math.cos(camberModes[k] * t), 0);

  // 3-D: half length, width and height for volume pi/6, and cos t of the centroid.
  function solid(parameters) {
    const betas = betasOf(parameters);
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

  // 3-D: points of the surface as the body lies, and outward normals, at t from nose to tail and
  // azimuth phi.
  function skin(parameters) {
    const [betas, { length, width, height, centre }] = [betasOf(parameters), solid(parameters)];
    const turned = noseUp(parameters);
    const rotated = ([x, y, z]) => {
      const [along, up] = turned([x, z]);
      return [along, y, up];
    };
    return (t, phi) => {
      const [r, sine, cosine] = [radius(betas, t), Math.sin(phi), Math.cos(phi)];
      const slope = betas.reduce((s, b, k) => s + b * modes[k] * Math.cos(modes[k] * t), Math.cos(t));
      const point = [-length * (Math.cos(t) - centre), width * r * cosine, height * r * sine];
      const across = [length * height * Math.sin(t) * cosine, length * width * Math.sin(t) * sine];
      return { point: rotated(point), normal: rotated([-width * height * slope, ...across]) };
    };
  }

  // Length from nose to tail at zero incidence, in D.
  const chord = (parameters) =>
    dimension === 3 ? 2 * solid(parameters).length : Math.sqrt(parameters[0]);

  // Contour at zero incidence, clockwise from the nose, centroid at the origin; 3-D: from the side.
  function outline(parameters, nodes) {
    const [betas, gammas] = [betasOf(parameters), gammasOf(parameters)];
    const angles = Array.from({ length: nodes }, (_, n) => (2 * Math.PI * n) / nodes);
    if (dimension === 3) {
      const { length, height, centre } = solid(parameters);
      return angles.map((t) => [-length * (Math.cos(t) - centre), height * radius(betas, t)]);
    }
    return centred(
      angles.map((t) => [
        (-chord(parameters) / 2) * Math.cos(t),
        (radius(betas, t) + camber(gammas, t)) / (2 * chord(parameters)),
      ]),
    );
  }

  // The polygon with its centroid at the origin.
  function centred(points) {
    let [area, along, above] = [0, 0, 0];
    points.forEach(([x, y], n) => {
      const [x1, y1] = points[(n + 1) % points.length];
      const cross = y * x1 - x * y1;
      area += cross / 2;
      along += ((x + x1) * cross) / 6;
      above += ((y + y1) * cross) / 6;
    });
    const lift = camberModes.length ? above / area : 0; // without camber y = 0 is the mirror plane
    return points.map(([x, y]) => [x - along / area, y - lift]);
  }

  // The rotation nose up by the incidence of a body.
  function noseUp(parameters) {
    const angle = (incidenceOf(parameters) * Math.PI) / 180;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return ([x, y]) => [x * c + y * s, y * c - x * s];
  }

  // Contour as the body lies in the stream: its outline turned nose up by the incidence.
  const contour = (parameters, nodes) => outline(parameters, nodes).map(noseUp(parameters));

  const { reference } = data;
  return {
    ...{ names, bounds, width, dimension, reference, incidenceOf },
    ...{ thicknessRatio, valid, clear, within, nearest, chord, outline, contour, skin },
  };
}
