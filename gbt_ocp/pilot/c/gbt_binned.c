#include "gbt_binned.h"

#include "gbt_linalg.h"
#include "gbt_math.h"
#include "gbt_mixed.h"

#define D GBT_DIMENSION
#define LEAST_COSINE ((gbt_real)0.05) /* of an elevation: straight above the vehicle there is no azimuth */
#define NEAREST ((gbt_real)1e-3)      /* range of a prediction, at least, for the error of the own position, m */

/* A track that has seen no full bin. */
static void begin(gbt_binned_filter *binned, int known, const gbt_real *start)
{
    binned->known = known;
    binned->lost.count = binned->lost.next = 0;
    for (int k = 0; k < D; k++) binned->own[k] = start[k];
    gbt_imm_ekf_begin(&binned->filter, known, start, binned->zero);
}

void gbt_binned_begin(gbt_binned_filter *binned, const gbt_binned_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&binned->gaps, GBT_SCATTER_S, 0);
    gbt_bins_clear(&binned->bins);
    binned->bins.latest = -HUGE_VAL;
    binned->restarts = 0;
    for (int k = 0; k < D; k++) binned->zero[k] = 0;
    begin(binned, settings->filter.guess.known, start);
}

void gbt_binned_shift(gbt_binned_filter *binned, const gbt_real *way)
{
    gbt_bins_shift(&binned->bins, way);
    gbt_imm_ekf_shift(&binned->filter, way);
    for (int k = 0; k < D; k++) {
        binned->own[k] -= way[k];
        binned->zero[k] -= way[k];
    }
}

/* The squared standardised innovation of a bearing, a component; 0 where nothing is predicted. */
static int innovation(const gbt_real *line, const gbt_real *covariance, const gbt_real *bearing, gbt_real noise,
                      gbt_real *square)
{
    const gbt_real distance = gbt_length(line);
    gbt_real unit[D], basis[GBT_AXES][D], angle[GBT_AXES], whitened[GBT_AXES], spread[GBT_AXES * GBT_AXES];
    for (int k = 0; k < D * D; k++)
        if (!isfinite(covariance[k])) return 0;
    if (!(distance > 0)) return 0;
    for (int k = 0; k < D; k++) unit[k] = line[k] / distance;
    gbt_tangent_basis(unit, basis);
    gbt_log_map(unit, bearing, basis, angle);
    gbt_across(basis, covariance, spread);
    for (int a = 0; a < GBT_AXES; a++) {
        whitened[a] = angle[a];
        for (int b = 0; b < GBT_AXES; b++) spread[a * GBT_AXES + b] /= distance * distance;
        spread[a * (GBT_AXES + 1)] += noise;
    }
    if (!gbt_solve_square(spread, GBT_AXES, whitened, 1)) return 0;
    *square = 0;
    for (int a = 0; a < GBT_AXES; a++) *square += angle[a] * whitened[a] / GBT_AXES;
    return 1;
}

/* Takes in the newest bin, now that it is full. */
static void step(gbt_binned_filter *binned, const gbt_binned_settings *settings)
{
    const gbt_bin *bin = &binned->bins.bin[binned->bins.count - 1];
    gbt_real mean[D], covariance[D * D], line[D], square;
    static const gbt_sighting nothing;
    gbt_sighting said = nothing;
    gbt_imm_ekf_predict(&binned->filter, &settings->filter, bin->time, mean, covariance);
    for (int k = 0; k < D; k++) line[k] = mean[k] - bin->own[k];
    const gbt_real white = gbt_white_variance(settings->noise.std, settings->noise.estimated, &binned->bins);
    const gbt_real noise = gbt_noise_of_mean(&settings->noise, bin->count, settings->binning.width,
                                             gbt_fmax(gbt_length(line), NEAREST), white);
    if (innovation(line, covariance, bin->bearing, noise, &square) && gbt_lost_after(&binned->lost, square)) {
        binned->restarts++;
        begin(binned, 0, bin->own);
    }
    said.time = bin->time;
    said.kind = D == 2 ? GBT_AZIMUTH : GBT_AZIMUTH_ELEVATION;
    said.stated = 1;
    gbt_angles_of(bin->bearing, said.value);
    for (int a = 0; a < GBT_AXES; a++) said.std[a] = gbt_sqrt(noise);
#if GBT_DIMENSION == 3
    said.std[0] /= gbt_fmax(gbt_cos(said.value[1]), LEAST_COSINE); /* an azimuth counts about the vertical */
#endif
    for (int k = 0; k < D; k++) said.position[k] = bin->own[k];
    gbt_imm_ekf_take(&binned->filter, &settings->filter, &said);
}

int gbt_binned_update(gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, const gbt_real *bearing,
                      const gbt_real *own)
{
    if (!gbt_bins_can_add(&binned->bins, &settings->binning, time)) return 0;
    if (gbt_gap_ended(&binned->gaps, time)) {
        gbt_bins_clear(&binned->bins);
        begin(binned, 0, own);
    }
    if (gbt_bins_filled_by(&binned->bins, &settings->binning, time)) step(binned, settings);
    gbt_bins_add(&binned->bins, &settings->binning, time, bearing, own, 0, 0, 1);
    for (int k = 0; k < D; k++) binned->own[k] = own[k];
    return 1;
}

void gbt_binned_predict(const gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, gbt_real *mean,
                        gbt_real *covariance)
{
    gbt_imm_ekf_predict(&binned->filter, &settings->filter, time, mean, covariance);
}

int gbt_binned_observable(const gbt_binned_filter *binned, const gbt_binned_settings *settings)
{
    gbt_real mean[D], covariance[D * D];
    if (!(binned->bins.latest > -HUGE_VAL)) return 0;
    gbt_binned_predict(binned, settings, binned->bins.latest, mean, covariance);
    for (int k = 0; k < D; k++) mean[k] -= binned->own[k];
    return gbt_relative_range_std(mean, covariance, D) < GBT_RANGE_OBSERVABLE;
}
