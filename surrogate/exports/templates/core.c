
/* The heads of the network, and by[head][feature] their derivatives in z. */
static void P_heads_L(real z[FEATURES][L], real f[HEADS][L], real by[HEADS][FEATURES][L],
                        int with_derivatives)
{
    real trace[NODES][L];
    for (int k = 0; k < FEATURES; k++)
        for (int v = 0; v < L; v++) trace[k][v] = z[k][v];
    int from = 0, to = FEATURES, weight = 0, bias = 0;
    for (int layer = 0; layer < LAYERS; layer++) {
        const int rows = SIZES[layer + 1], columns = SIZES[layer];
        for (int i = 0; i < rows; i++) {
            real sum[L];
            for (int v = 0; v < L; v++) sum[v] = BIASES[bias + i];
            for (int j = 0; j < columns; j++) {
                const real w = WEIGHTS[weight + i * columns + j];
                for (int v = 0; v < L; v++) sum[v] += w * trace[from + j][v];
            }
            if (layer < LAYERS - 1)
                for (int v = 0; v < L; v++) trace[to + i][v] = P_tanh(sum[v]);
            else
                for (int v = 0; v < L; v++) f[i][v] = sum[v];
        }
        from = to;
        to += rows;
        weight += rows * columns;
        bias += rows;
    }
    for (int l = 0; l < HEADS; l++) {
        for (int v = 0; v < L; v++) f[l][v] += CONSTANT[l];
        for (int i = 0; i < FEATURES; i++) {
            real sum[L];
            for (int v = 0; v < L; v++) sum[v] = 0;
            for (int j = 0; j < FEATURES; j++) {
                const real w = QUADRATIC[l][i][j];
                for (int v = 0; v < L; v++) sum[v] += w * z[j][v];
            }
            for (int v = 0; v < L; v++) f[l][v] += (LINEAR[l][i] + sum[v]) * z[i][v];
            if (with_derivatives)
                for (int v = 0; v < L; v++) by[l][i][v] = LINEAR[l][i] + 2 * sum[v];
        }
    }
    if (!with_derivatives) return;
    for (int l = 0; l < HEADS; l++) { /* backpropagation */
        real back[WIDEST][L], next[WIDEST][L];
        int end = from, last = weight - HEADS * SIZES[LAYERS - 1];
        for (int j = 0; j < SIZES[LAYERS - 1]; j++)
            for (int v = 0; v < L; v++) back[j][v] = WEIGHTS[last + l * SIZES[LAYERS - 1] + j];
        for (int layer = LAYERS - 2; layer >= 0; layer--) {
            const int rows = SIZES[layer + 1], columns = SIZES[layer];
            end -= rows;
            last -= rows * columns;
            for (int i = 0; i < rows; i++)
                for (int v = 0; v < L; v++)
                    back[i][v] *= 1 - trace[end + i][v] * trace[end + i][v];
            for (int j = 0; j < columns; j++) {
                real sum[L];
                for (int v = 0; v < L; v++) sum[v] = 0;
                for (int i = 0; i < rows; i++) {
                    const real w = WEIGHTS[last + i * columns + j];
                    for (int v = 0; v < L; v++) sum[v] += w * back[i][v];
                }
                for (int v = 0; v < L; v++) next[j][v] = sum[v];
            }
            for (int j = 0; j < columns; j++)
                for (int v = 0; v < L; v++) back[j][v] = next[j][v];
        }
        for (int k = 0; k < FEATURES; k++)
            for (int v = 0; v < L; v++) by[l][k][v] += back[k][v];
    }
}

/* Outputs before they are made even or odd, and their derivatives in z: of 3-D bodies at incidence
 * the parts of the moment are summed up. */
static void P_outputs_L(real z[FEATURES][L], real f[HEADS][L], real by[HEADS][FEATURES][L],
                        int with_derivatives)
{
    P_heads_L(z, f, by, with_derivatives);
    if (INCIDENCE < 0) return;
    enum { RE = INPUTS - 1, LAST = FEATURES - 1, MOMENT = LOADS - 1 };
    for (int v = 0; v < L; v++) {
        const real inertia = 1 / (1 + INERTIAL[0] * R(exp)((SHIFT[RE] - z[LAST][v]) / SCALE[RE]));
        const real own = f[MOMENT][v];
        f[MOMENT][v] *= inertia;
        if (with_derivatives) {
            for (int k = 0; k < FEATURES; k++) by[MOMENT][k][v] *= inertia;
            by[MOMENT][LAST][v] += own * inertia * (1 - inertia) / SCALE[RE];
        }
    }
    for (int l = LOADS; l < HEADS; l++) {
        const int stokes = STOKES[l - LOADS];
        for (int v = 0; v < L; v++) f[MOMENT][v] += z[stokes][v] * f[l][v];
        if (!with_derivatives) continue;
        for (int k = 0; k < FEATURES; k++)
            for (int v = 0; v < L; v++) by[MOMENT][k][v] += z[stokes][v] * by[l][k][v];
        for (int v = 0; v < L; v++) by[MOMENT][stokes][v] += f[l][v];
    }
}

/* 1 and the waves of the incidence by which features are multiplied, and their derivatives in its
 * scaled input, which is set to 1. */
static void P_waves_L(real s[INPUTS][L], real wave[WAVES][L], real slope[WAVES][L])
{
    for (int v = 0; v < L; v++) {
        wave[0][v] = 1;
        slope[0][v] = 0;
    }
    if (INCIDENCE < 0) return;
    for (int v = 0; v < L; v++) {
        const real a = ANGLE[0] * s[INCIDENCE < 0 ? 0 : INCIDENCE][v], c = R(cos)(a), si = R(sin)(a);
        wave[1][v] = c;
        wave[2][v] = si;
        wave[3][v] = (c - si) * (c + si);
        wave[4][v] = 2 * c * si;
        for (int n = 1; n <= 2; n++) {
            slope[2 * n - 1][v] = -(real)n * ANGLE[0] * wave[2 * n][v];
            slope[2 * n][v] = (real)n * ANGLE[0] * wave[2 * n - 1][v];
        }
        s[INCIDENCE < 0 ? 0 : INCIDENCE][v] = 1;
    }
}

/* Loads of L cases at inputs[case][input]; jacobian[case][load][input] may be NULL. */
static void P_cases_L(const real *inputs, real *loads, real *jacobian)
{
    real s[INPUTS][L], z[FEATURES][L], f[HEADS][L], by[HEADS][FEATURES][L] = {{{0}}};
    real wave[WAVES][L] = {{0}}, slope[WAVES][L] = {{0}};
    for (int k = 0; k < INPUTS; k++)
        for (int v = 0; v < L; v++) {
            const real x = inputs[v * INPUTS + k];
            s[k][v] = SCALE[k] * (LOGS[k] ? R(log)(x) : x) + SHIFT[k];
        }
    P_waves_L(s, wave, slope);
    for (int j = 0; j < FEATURES; j++)
        for (int v = 0; v < L; v++) z[j][v] = s[SOURCE[j]][v] * wave[WAVE[j]][v];
    P_outputs_L(z, f, by, jacobian != NULL);
    if (LOADS > 1) { /* the part that is even (Cd) or odd (Cl, Cm) under the mirror image */
        real image[HEADS][L], by_image[HEADS][FEATURES][L] = {{{0}}};
        for (int k = 0; k < FEATURES; k++)
            for (int v = 0; v < L; v++) z[k][v] *= MIRROR[k];
        P_outputs_L(z, image, by_image, jacobian != NULL);
        for (int l = 0; l < LOADS; l++) {
            const real parity = l ? -1 : 1;
            for (int v = 0; v < L; v++) f[l][v] = (f[l][v] + parity * image[l][v]) / 2;
            if (jacobian != NULL)
                for (int k = 0; k < FEATURES; k++)
                    for (int v = 0; v < L; v++)
                        by[l][k][v] = (by[l][k][v] + parity * MIRROR[k] * by_image[l][k][v]) / 2;
        }
    }
    for (int v = 0; v < L; v++) {
        const real cd = R(exp)(f[0][v]);
        for (int l = 0; l < LOADS; l++) loads[v * LOADS + l] = l ? cd * f[l][v] : cd;
        if (jacobian == NULL) continue;
        for (int l = 0; l < LOADS; l++) {
            real *row = jacobian + (v * LOADS + l) * INPUTS;
            for (int k = 0; k < INPUTS; k++) row[k] = 0;
            for (int j = 0; j < FEATURES; j++) {
                const real own = cd * (l ? by[l][j][v] + f[l][v] * by[0][j][v] : by[0][j][v]);
                if (SOURCE[j] != INCIDENCE) row[SOURCE[j]] += own * wave[WAVE[j]][v];
                if (INCIDENCE >= 0) row[INCIDENCE < 0 ? 0 : INCIDENCE] += own * s[SOURCE[j]][v] * slope[WAVE[j]][v];
            }
            for (int k = 0; k < INPUTS; k++)
                row[k] *= SCALE[k] / (LOGS[k] ? inputs[v * INPUTS + k] : 1);
        }
    }
}
