#include "gbt_ekf.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_N
#define NEAREST ((gbt_real)1e-2)           /* range below which a bearing says no more about the position across it, m */
#define UNKNOWN_ELEVATION ((gbt_real)0.5)  /* deviation of the elevation at a first azimuth, rad */
#define FILTER_WINDOW 100                  /* measurements that count as the window of a filter */

static const gbt_own_velocities unmoved;

size_t gbt_ekf_bytes(void) { return sizeof(gbt_ekf); }

void gbt_ekf_begin(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&filter->gaps, 0, FILTER_WINDOW);
    filter->begun = 0;
    filter->time = 0;
    filter->known = settings->known;
    filter->own = unmoved;
    for (int k = 0; k < D; k++) {
        filter->start[k] = start[k];
        filter->zero[k] = 0;
    }
    for (int i = 0; i < N; i++) {
        filter->mean[i] = 0;
        for (int j = 0; j < N; j++) filter->covariance[i][j] = 0;
    }
}

void gbt_ekf_shift(gbt_ekf *filter, const gbt_real *way)
{
    for (int k = 0; k < D; k++) {
        filter->start[k] -= way[k];
        filter->zero[k] -= way[k];
        if (filter->begun) filter->mean[k] -= way[k];
        for (int s = 0; s < GBT_SENSORS; s++) filter->own.position[s][k] -= way[k];
    }
}

/* A new track: the position is not known any more. */
static void restart(gbt_ekf *filter, const gbt_real *own)
{
    filter->begun = 0;
    filter->known = 0;
    filter->own = unmoved;
    for (int k = 0; k < D; k++) filter->start[k] = own[k];
}

/* A position on a bearing: across it wide enough to leave that to the bearing, and no wider. */
static void on_bearing(const gbt_ekf_settings *settings, const gbt_real *bearing, const gbt_real *own, gbt_real deviation,
                       gbt_real *mean, gbt_real covariance[D][D])
{
    const gbt_real across = gbt_fmax(10 * deviation, (gbt_real)0.1) * settings->range;
    for (int i = 0; i < D; i++) {
        mean[i] = own[i] + settings->range * bearing[i];
        for (int j = 0; j < D; j++) {
            const gbt_real along = bearing[i] * bearing[j];
            covariance[i][j] = settings->range_std * settings->range_std * along + across * across * ((i == j) - along);
        }
    }
}

/* The position before the first measurement is taken; 0 if that does not say where the target is and nothing else does. */
static int first_guess(const gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting,
                       gbt_real *mean, gbt_real covariance[D][D])
{
    const int azimuth = sighting->kind == GBT_AZIMUTH, both = sighting->kind == GBT_AZIMUTH_ELEVATION;
    gbt_real bearing[D], deviation = settings->bearing_std;
    const gbt_real angles[2] = {sighting->value[0], both ? sighting->value[1] : 0};
    if (filter->known) {
        for (int i = 0; i < D; i++) {
            mean[i] = filter->zero[i] + settings->known_mean[i];
            for (int j = 0; j < D; j++) covariance[i][j] = settings->known_covariance[i][j];
        }
        return 1;
    }
    if (sighting->kind == GBT_POSITION) {
        for (int i = 0; i < D; i++) {
            mean[i] = sighting->value[i];
            for (int j = 0; j < D; j++) covariance[i][j] = i == j ? 4 * sighting->std[i] * sighting->std[i] : 0;
        }
        return 1;
    }
    if (!azimuth && !both) return 0;
    for (int k = 0; sighting->stated && k < gbt_components(sighting->kind); k++)
        deviation = gbt_fmax(deviation, sighting->std[k]);
    gbt_unit_of_angles(angles, bearing);
    on_bearing(settings, bearing, sighting->position, deviation, mean, covariance);
    if (azimuth && D == 3)
        covariance[D - 1][D - 1] += UNKNOWN_ELEVATION * settings->range * UNKNOWN_ELEVATION * settings->range;
    return 1;
}

static void step_ahead(gbt_ekf *filter, const gbt_ekf_settings *settings, double seconds)
{
    const gbt_real t = (gbt_real)seconds, q = settings->process_noise;
    gbt_real transition[N][N], moved[N][N];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) transition[i][j] = i == j ? 1 : i < D && j == i + D ? t : 0;
    gbt_congruent(&transition[0][0], &filter->covariance[0][0], N, &moved[0][0]);
    for (int k = 0; k < D; k++) {
        moved[k][k] += q * (t * t * t / 3);
        moved[k][k + D] += q * (t * t / 2);
        moved[k + D][k] += q * (t * t / 2);
        moved[k + D][k + D] += q * t;
        filter->mean[k] += t * filter->mean[k + D];
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) filter->covariance[i][j] = moved[i][j];
}

/* Brings the state to the time of a measurement; 0 where a new track cannot begin with it. */
static int advance(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting)
{
    gbt_real spread[D][D];
    if (gbt_gap_ended(&filter->gaps, sighting->time)) restart(filter, sighting->position);
    if (filter->begun) {
        step_ahead(filter, settings, sighting->time - filter->time);
    } else {
        if (!first_guess(filter, settings, sighting, filter->mean, spread)) return 0;
        for (int i = 0; i < N; i++) {
            if (i >= D) filter->mean[i] = i < 2 * D ? 0 : settings->log_size;
            for (int j = 0; j < N; j++)
                filter->covariance[i][j] = i < D && j < D ? spread[i][j]
                                           : i != j       ? 0
                                           : i < 2 * D    ? settings->speed_std * settings->speed_std
                                                          : settings->log_size_std * settings->log_size_std;
        }
        filter->begun = 1;
    }
    filter->time = sighting->time;
    return 1;
}

/* A bearing that does not state its deviation, along the tangent of the predicted one. */
static int update(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting)
{
    gbt_real seen[D], unit[D], basis[GBT_AXES][D], observation[GBT_MOST_ROWS][N], angle[D], std[D];
    int apart = 0;
    if (filter->begun && !(sighting->time > filter->time)) return 0;
    gbt_unit_of_angles(sighting->value, seen);
    if (!advance(filter, settings, sighting)) return 0;
    for (int k = 0; k < D; k++) {
        unit[k] = filter->mean[k] - sighting->position[k];
        if (gbt_fabs(unit[k]) > 0) apart = 1;
    }
    for (int k = 0; !apart && k < D; k++) unit[k] = NEAREST * seen[k];
    const gbt_real distance = gbt_length(unit);
    for (int k = 0; k < D; k++) unit[k] /= distance;
    gbt_tangent_basis(unit, basis);
    gbt_log_map(unit, seen, basis, angle);
    for (int a = 0; a < GBT_AXES; a++) {
        for (int j = 0; j < N; j++) observation[a][j] = j < D ? basis[a][j] / gbt_fmax(distance, NEAREST) : 0;
        std[a] = settings->bearing_std;
    }
    return gbt_kalman_update(filter->mean, filter->covariance, GBT_AXES, observation, std, angle);
}

int gbt_ekf_take(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting)
{
    gbt_polar_rows rows;
    gbt_real mean[D], spread[D][D];
    if (!gbt_can_take(sighting, filter->begun, filter->time)) return 0;
    if (gbt_is_bearing(sighting) && !sighting->stated) return update(filter, settings, sighting);
    if (!filter->begun && !first_guess(filter, settings, sighting, mean, spread)) return 0;
    if (!advance(filter, settings, sighting)) return 0;
    gbt_polar_of(sighting, filter->mean, settings->bearing_std, filter->mean[N - 1], &rows);
    gbt_own_velocity(&filter->own, sighting);
    return gbt_polar_update(filter->mean, filter->covariance, &rows, sighting->position, filter->own.velocity);
}

void gbt_ekf_predict(const gbt_ekf *filter, const gbt_ekf_settings *settings, double time, gbt_real *mean,
                     gbt_real *covariance)
{
    const gbt_real t = (gbt_real)(time - filter->time), q = settings->process_noise;
    for (int i = 0; i < D; i++) {
        if (!filter->begun) {
            mean[i] = filter->known ? filter->zero[i] + settings->known_mean[i] : filter->start[i];
            for (int j = 0; j < D; j++) covariance[i * D + j] = (gbt_real)NAN;
            continue;
        }
        mean[i] = filter->mean[i] + t * filter->mean[i + D];
        for (int j = 0; j < D; j++) {
            const gbt_real crossed = filter->covariance[i][j + D] + filter->covariance[i + D][j];
            const gbt_real moved = filter->covariance[i][j] + t * crossed + t * t * filter->covariance[i + D][j + D];
            covariance[i * D + j] = moved + (i == j ? q * (t * t * t / 3) : 0);
        }
    }
}
