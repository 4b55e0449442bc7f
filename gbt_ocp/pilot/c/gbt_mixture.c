#include "gbt_mixture.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define M GBT_MEMBERS
#define ASTRAY ((gbt_real)0.01)        /* probability that a bin says nothing of the target: no single one decides */
#define LEAST_WEIGHT ((gbt_real)1e-4)  /* below which a member is left out of a forecast */
#define NO_DIRECTION ((gbt_real)1e-4)  /* range below which a predicted position has no direction; the measured one stands in */
#define FARTHEST ((gbt_real)0.4)       /* angle between predicted and measured bearing beyond which that has the tangent */

size_t gbt_mixture_bytes(void) { return sizeof(gbt_mixture); }
size_t gbt_mixture_work_bytes(void) { return sizeof(gbt_mixture_work); }

/* ---- members ---- */

int gbt_mixture_restarts(const gbt_mixture *mixture) { return mixture->held.restarts + mixture->models.restarts; }

void gbt_mixture_believe(const gbt_mixture *mixture, const gbt_mixture_settings *settings, int member, double time,
                         gbt_real *mean, gbt_real *covariance)
{
    if (settings->member[member] == GBT_MEMBER_HELD_TURN)
        gbt_held_turn_predict(&mixture->held, &settings->held, time, mean, covariance);
    else
        gbt_binned_predict(&mixture->models, &settings->models, time, mean, covariance);
}

void gbt_mixture_ask(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work, double time)
{
    gbt_held_turn_ask(&mixture->held, &settings->held, work, time);
}

static int tells_range(const gbt_mixture *mixture, const gbt_mixture_settings *settings, int member)
{
    if (settings->member[member] == GBT_MEMBER_HELD_TURN) return mixture->held.observable;
    return gbt_binned_observable(&mixture->models, &settings->models);
}

/* Whether a member has begun; interacting models before their first full bin know no covariance. */
static int has_covariance(const gbt_mixture *mixture, const gbt_mixture_settings *settings, int member)
{
    return settings->member[member] == GBT_MEMBER_HELD_TURN || mixture->models.filter.begun;
}

/* The members that a forecast is made of, with weights that sum to one. */
static void choose(gbt_mixture *mixture, const gbt_mixture_settings *settings)
{
    gbt_real *weight = mixture->weight, known[M], top = -GBT_INFINITY, total = 0, told = 0;
    int begun = mixture->seen, counted = 0;
    for (int m = 0; m < M; m++) top = gbt_fmax(top, mixture->evidence[m]);
    for (int m = 0; m < M; m++) total += weight[m] = gbt_exp(mixture->evidence[m] - top);
    for (int m = 0; m < M; m++) {
        weight[m] /= total;
        known[m] = tells_range(mixture, settings, m) ? weight[m] : 0;
        told += known[m];
        begun = begun && has_covariance(mixture, settings, m);
    }
    mixture->told = told >= (gbt_real)0.5;
    total = 0;
    for (int m = 0; m < M; m++) {
        if (mixture->told) weight[m] = known[m];
        else if (!begun) weight[m] = m == 0;
        total += weight[m];
    }
    for (int m = 0; m < M; m++) {
        if (!(weight[m] > LEAST_WEIGHT * total)) weight[m] = 0;
        counted += weight[m] > 0;
    }
    if (counted == 1) mixture->told = 1;
    total = 0;
    for (int m = 0; m < M; m++) total += weight[m];
    for (int m = 0; m < M; m++) weight[m] /= total;
}

/* ---- evidence ---- */

/* Logarithm of the density of a mean bearing in angles under a predicted position. */
static gbt_real log_density(const gbt_mixture_settings *settings, const gbt_bin *bin, const gbt_real *mean,
                            const gbt_real *covariance, gbt_real white)
{
    const gbt_bearing_noise *noise = &settings->noise;
    gbt_real line[D], expected[D], basis[GBT_AXES][D], angle[GBT_AXES], spread[GBT_AXES * GBT_AXES];
    gbt_real axes[GBT_AXES * GBT_AXES], square = 0, density = 0;
    for (int k = 0; k < D; k++) line[k] = mean[k] - bin->own[k];
    const gbt_real distance = gbt_length(line), range = gbt_fmax(distance, NO_DIRECTION);
    for (int k = 0; k < D; k++) expected[k] = distance < NO_DIRECTION ? bin->bearing[k] : line[k] / distance;
    gbt_tangent_basis(expected, basis);
    gbt_log_map(expected, bin->bearing, basis, angle);
    for (int a = 0; a < GBT_AXES; a++) square += angle[a] * angle[a];
    if (gbt_sqrt(square) > FARTHEST) gbt_tangent_basis(bin->bearing, basis);
    gbt_across(basis, covariance, spread);
    for (int a = 0; a < GBT_AXES * GBT_AXES; a++) spread[a] /= range * range;
    for (int a = 0; a < GBT_AXES; a++) {
        const gbt_real own = noise->own_std / range;
        spread[a * (GBT_AXES + 1)] += (white + own * own) / bin->count + noise->correlated_std * noise->correlated_std;
    }
    for (int a = 0; a < GBT_AXES * GBT_AXES; a++)
        if (!isfinite(spread[a])) return -GBT_INFINITY;
    gbt_eigen(spread, GBT_AXES, axes);
    for (int c = 0; c < GBT_AXES; c++) {
        /* the least there is; below it is round-off */
        const gbt_real variance = gbt_fmax(spread[c * (GBT_AXES + 1)], white / bin->count);
        gbt_real off = 0;
        for (int a = 0; a < GBT_AXES; a++) off += angle[a] * axes[a * GBT_AXES + c];
        density -= (off * off / variance + gbt_log(GBT_TURN * variance)) / 2;
    }
    return density;
}

/* Logarithm of the sum of the exponentials. */
static gbt_real log_sum(gbt_real a, gbt_real b)
{
    return gbt_fmax(a, b) + gbt_log1p(gbt_exp(-gbt_fabs(a - b)));
}

/* Judges the members by the bin that has just been filled: what they said of it before it began. */
static void score(gbt_mixture *mixture, const gbt_mixture_settings *settings, double begins)
{
    if (!mixture->predicted) return;
    const gbt_bin *bin = &mixture->bins.bin[mixture->bins.count - 1];
    const gbt_real late = (gbt_real)((bin->time - mixture->begins) / settings->binning.width);
    const gbt_real fades = (gbt_real)exp((mixture->begins - begins) / settings->forgetting);
    const gbt_real white = gbt_white_variance(settings->noise.std, settings->noise.estimated, &mixture->bins);
    const gbt_real uniform = -gbt_log((gbt_real)(D == 2 ? 1 : 2) * GBT_TURN);
    for (int m = 0; m < M; m++) {
        gbt_real mean[D], covariance[D * D];
        for (int i = 0; i < D; i++) {
            mean[i] = (1 - late) * mixture->mean[m][0][i] + late * mixture->mean[m][1][i];
            for (int j = 0; j < D; j++)
                covariance[i * D + j] =
                    (1 - late) * mixture->covariance[m][0][i][j] + late * mixture->covariance[m][1][i][j];
        }
        const gbt_real density = log_density(settings, bin, mean, covariance, white);
        mixture->evidence[m] += log_sum(gbt_log1p(-ASTRAY) + density, gbt_log(ASTRAY) + uniform);
        mixture->evidence[m] *= fades;
    }
}

/* ---- the mixture ---- */

static void begin(gbt_mixture *mixture, const gbt_real *own)
{
    gbt_bins_clear(&mixture->bins);
    mixture->begins = -HUGE_VAL;
    mixture->predicted = 0;
    for (int m = 0; m < M; m++) mixture->evidence[m] = 0;
    for (int k = 0; k < D; k++) mixture->own[k] = own[k];
}

void gbt_mixture_begin(gbt_mixture *mixture, const gbt_mixture_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&mixture->gaps, GBT_SCATTER_S, 0);
    mixture->bins.latest = mixture->latest = -HUGE_VAL;
    mixture->seen = 0;
    begin(mixture, start);
    gbt_held_turn_begin(&mixture->held, &settings->held, start);
    gbt_binned_begin(&mixture->models, &settings->models, start);
    choose(mixture, settings);
}

void gbt_mixture_shift(gbt_mixture *mixture, const gbt_real *way)
{
    gbt_bins_shift(&mixture->bins, way);
    gbt_held_turn_shift(&mixture->held, way);
    gbt_binned_shift(&mixture->models, way);
    for (int k = 0; k < D; k++) {
        mixture->own[k] -= way[k];
        for (int m = 0; m < 2 * M; m++) mixture->mean[m / 2][m % 2][k] -= way[k];
    }
}

/* Begins a new track after a gap: the members find the same one themselves. */
static void note(gbt_mixture *mixture, double time, const gbt_real *own)
{
    if (gbt_gap_ended(&mixture->gaps, time)) begin(mixture, own);
    mixture->latest = time;
}

/* Judges the members by a bin that is full, and adds a bearing to the newest one. */
static void see(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work, double time,
                const gbt_real *bearing, const gbt_real *own, gbt_real weight)
{
    const double width = settings->binning.width, begins = floor(time / width) * width;
    if (begins != mixture->begins) {
        score(mixture, settings, begins);
        mixture->begins = begins;
        mixture->predicted = mixture->bins.count > 0;
        gbt_mixture_ask(mixture, settings, work, begins + width);
        for (int m = 0; mixture->predicted && m < M; m++)
            for (int end = 0; end < 2; end++)
                gbt_mixture_believe(mixture, settings, m, begins + end * width, mixture->mean[m][end],
                                    mixture->covariance[m][end][0]);
    }
    for (int k = 0; k < D; k++) mixture->own[k] = own[k];
    mixture->seen = 1;
    gbt_bins_add(&mixture->bins, &settings->binning, time, bearing, own, 0, 0, weight);
}

int gbt_mixture_update(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work, double time,
                       const gbt_real *bearing, const gbt_real *own)
{
    if (time < mixture->latest || !gbt_bins_can_add(&mixture->bins, &settings->binning, time)) return 0;
    note(mixture, time, own);
    see(mixture, settings, work, time, bearing, own, 1);
    for (int m = 0; m < M; m++) {
        if (settings->member[m] == GBT_MEMBER_HELD_TURN)
            gbt_held_turn_update(&mixture->held, &settings->held, work, time, bearing, own);
        else
            gbt_binned_update(&mixture->models, &settings->models, time, bearing, own);
    }
    choose(mixture, settings);
    return 1;
}

int gbt_mixture_take(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work,
                     const gbt_sighting *sighting)
{
    const gbt_real std = settings->noise.std;
    const double time = sighting->time;
    gbt_sighting_parts parts;
    if (!gbt_take_apart(sighting, mixture->latest, &mixture->bins, &settings->binning, std, &parts)) return 0;
    if (!gbt_waiting_room(&mixture->held.waiting, settings->held.binning.width, time)) return 0;
    if (!gbt_waiting_room(&mixture->models.waiting, settings->models.binning.width, time)) return 0;
    note(mixture, time, sighting->position);
    if (parts.bearing)
        see(mixture, settings, work, time, parts.unit, sighting->position, gbt_worth(&parts, std));
    for (int m = 0; m < M; m++) {
        if (settings->member[m] == GBT_MEMBER_HELD_TURN)
            gbt_held_turn_take(&mixture->held, &settings->held, work, sighting);
        else
            gbt_binned_take(&mixture->models, &settings->models, sighting);
    }
    choose(mixture, settings);
    return 1;
}

void gbt_mixture_predict(const gbt_mixture *mixture, const gbt_mixture_settings *settings, double time, gbt_real *mean,
                         gbt_real *covariance)
{
    gbt_mixed mixed;
    gbt_mixed_begin(&mixed, !mixture->told);
    for (int m = 0; m < M; m++) {
        if (!(mixture->weight[m] > 0)) continue;
        gbt_mixture_believe(mixture, settings, m, time, mean, covariance);
        for (int k = 0; !mixture->told && k < D; k++) mean[k] -= mixture->own[k];
        gbt_mixed_add(&mixed, mixture->weight[m], mean, covariance);
    }
    gbt_mixed_moments(&mixed, mean, covariance);
    for (int k = 0; !mixture->told && k < D; k++) mean[k] += mixture->own[k];
}

void gbt_mixture_forecast(gbt_mixture *mixture, const gbt_mixture_settings *settings, gbt_mixture_work *work,
                         const double *time, int count, gbt_real *mean, gbt_real *covariance)
{
    for (int k = 0; k < count; k++) {
        gbt_mixture_ask(mixture, settings, work, time[k]);
        gbt_mixture_predict(mixture, settings, time[k], &mean[k * D], &covariance[k * D * D]);
    }
}
