#include "gbt_binned.h"

#include "gbt_linalg.h"
#include "gbt_math.h"
#include "gbt_mixed.h"

#define D GBT_DIMENSION
#define LEAST_COSINE ((gbt_real)0.05) /* of an elevation: straight above the vehicle there is no azimuth */
#define ON_TIME 1e-9                  /* rounding of a mean time, s */
#define NEAREST ((gbt_real)1e-3)      /* range of a prediction, at least, for the error of the own position, m */

/* A track that has seen no full bin. */
static void begin(gbt_binned_filter *binned, int known, const gbt_real *start)
{
    binned->known = known;
    binned->lost.count = binned->lost.next = 0;
    binned->begun = binned->foreseen = 0;
    for (int k = 0; k < D; k++) binned->own[k] = start[k];
    gbt_imm_ekf_begin(&binned->filter, known, start, binned->zero);
}

void gbt_binned_begin(gbt_binned_filter *binned, const gbt_binned_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&binned->gaps, GBT_SCATTER_S, 0);
    gbt_bins_clear(&binned->bins);
    gbt_waiting_begin(&binned->waiting);
    binned->bins.latest = -HUGE_VAL;
    binned->restarts = 0;
    for (int k = 0; k < D; k++) binned->zero[k] = 0;
    begin(binned, settings->filter.guess.known, start);
}

void gbt_binned_shift(gbt_binned_filter *binned, const gbt_real *way)
{
    gbt_bins_shift(&binned->bins, way);
    gbt_waiting_shift(&binned->waiting, way);
    gbt_imm_ekf_shift(&binned->filter, way);
    gbt_imm_ekf_shift(&binned->foreseeing, way);
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

/* Takes in the newest bin, now that it is full, and what has waited for it. */
static void step(gbt_binned_filter *binned, const gbt_binned_settings *settings)
{
    const gbt_bin *bin = &binned->bins.bin[binned->bins.count - 1];
    gbt_waiting *waiting = &binned->waiting;
    gbt_real mean[D], covariance[D * D], line[D], square;
    gbt_sighting said = (gbt_sighting){0};
    int early = 0;
    /* a filter begins with a bearing */
    while (binned->begun && early < waiting->count && waiting->sighting[early].time < bin->time - ON_TIME)
        gbt_imm_ekf_take(&binned->filter, &settings->filter, &waiting->sighting[early++]);
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
    said.sensor = GBT_OF_BINS;
    said.stated = 1;
    gbt_angles_of(bin->bearing, said.value);
    for (int a = 0; a < GBT_AXES; a++) said.std[a] = gbt_sqrt(noise);
#if GBT_DIMENSION == 3
    said.std[0] /= gbt_fmax(gbt_cos(said.value[1]), LEAST_COSINE); /* an azimuth counts about the vertical */
#endif
    for (int k = 0; k < D; k++) said.position[k] = bin->own[k];
    gbt_imm_ekf_take(&binned->filter, &settings->filter, &said);
    for (int k = early; k < waiting->count; k++) {
        /* what is earlier than the mean of the first bin, by less than its width, counts as of its time */
        waiting->sighting[k].time = fmax(waiting->sighting[k].time, said.time);
        gbt_imm_ekf_take(&binned->filter, &settings->filter, &waiting->sighting[k]);
    }
    waiting->count = 0;
    waiting->full = binned->begun = 1;
}

/* Begins a new track after a gap; takes in the newest bin once that is full. */
static void note(gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, const gbt_real *own)
{
    gbt_waiting *waiting = &binned->waiting;
    if (gbt_gap_ended(&binned->gaps, time)) {
        gbt_bins_clear(&binned->bins);
        gbt_waiting_clear(waiting);
        begin(binned, 0, own);
    }
    waiting->latest = time;
    if (!waiting->full && gbt_bins_filled_by(&binned->bins, &settings->binning, time)) step(binned, settings);
    if (waiting->full) gbt_waiting_forget(waiting, settings->binning.width, time);
}

/* Takes in a bearing that is worth so many ordinary ones. */
static void see(gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, const gbt_real *bearing,
                const gbt_real *own, gbt_real weight)
{
    note(binned, settings, time, own);
    gbt_bins_add(&binned->bins, &settings->binning, time, bearing, own, 0, 0, weight);
    binned->waiting.full = 0;
    for (int k = 0; k < D; k++) binned->own[k] = own[k];
}

/* Has what waits for the newest bin in a filter of its own. */
static void foresee(gbt_binned_filter *binned, const gbt_binned_settings *settings)
{
    binned->foreseen = binned->begun && binned->waiting.count > 0;
    if (!binned->foreseen) return;
    binned->foreseeing = binned->filter;
    for (int k = 0; k < binned->waiting.count; k++)
        gbt_imm_ekf_take(&binned->foreseeing, &settings->filter, &binned->waiting.sighting[k]);
}

int gbt_binned_update(gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, const gbt_real *bearing,
                      const gbt_real *own)
{
    if (time < binned->waiting.latest || !gbt_bins_can_add(&binned->bins, &settings->binning, time)) return 0;
    see(binned, settings, time, bearing, own, 1);
    foresee(binned, settings);
    return 1;
}

int gbt_binned_take(gbt_binned_filter *binned, const gbt_binned_settings *settings, const gbt_sighting *sighting)
{
    const gbt_real std = settings->noise.std, *own = sighting->position;
    gbt_sighting_parts parts;
    if (!gbt_take_apart(sighting, binned->waiting.latest, &binned->bins, &settings->binning, std, &parts)) return 0;
    if (!gbt_waiting_room(&binned->waiting, settings->binning.width, sighting->time)) return 0;
    if (parts.bearing)
        see(binned, settings, sighting->time, parts.unit, own, gbt_worth(&parts, std));
    else
        note(binned, settings, sighting->time, own);
    if (parts.single && binned->begun && binned->waiting.full)
        gbt_imm_ekf_take(&binned->filter, &settings->filter, &parts.rest);
    else if (parts.single)
        gbt_waiting_add(&binned->waiting, &parts.rest);
    foresee(binned, settings);
    return 1;
}

void gbt_binned_predict(const gbt_binned_filter *binned, const gbt_binned_settings *settings, double time, gbt_real *mean,
                        gbt_real *covariance)
{
    const gbt_imm_ekf *filter = binned->foreseen ? &binned->foreseeing : &binned->filter;
    gbt_imm_ekf_predict(filter, &settings->filter, time, mean, covariance);
}

int gbt_binned_observable(const gbt_binned_filter *binned, const gbt_binned_settings *settings)
{
    gbt_real mean[D], covariance[D * D];
    if (!(binned->bins.latest > -HUGE_VAL)) return 0;
    gbt_binned_predict(binned, settings, binned->bins.latest, mean, covariance);
    for (int k = 0; k < D; k++) mean[k] -= binned->own[k];
    return gbt_relative_range_std(mean, covariance, D) < GBT_RANGE_OBSERVABLE;
}
