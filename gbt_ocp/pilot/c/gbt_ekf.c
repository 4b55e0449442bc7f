#include "gbt_ekf.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_N
#define NEAREST ((gbt_real)1e-2)           /* range below which a bearing says no more about the position across it, m */
#define FILTER_WINDOW 100                  /* measurements that count as the window of a filter */

static const gbt_own_velocities unmoved;

size_t gbt_ekf_bytes(void) { return sizeof(gbt_ekf); }

void gbt_ekf_begin(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&filter->gaps, 0, FILTER_WINDOW);
    filter->begun = 0;
    filter->time = 0;
    filter->known = settings->guess.known;
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
        for (int s = 0; s <= GBT_SENSORS; s++) filter->own.position[s][k] -= way[k];
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
        if (!gbt_guess(&settings->guess, filter->known, filter->zero, sighting, filter->mean, spread)) return 0;
        for (int i = 0; i < N; i++) {
            if (i >= D) filter->mean[i] = i < 2 * D ? 0 : settings->log_size;
            for (int j = 0; j < N; j++)
                filter->covariance[i][j] = i < D && j < D ? spread[i][j]
                                           : i != j       ? 0
                                           : i < 2 * D    ? settings->guess.speed_std * settings->guess.speed_std
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
        std[a] = settings->guess.bearing_std;
    }
    return gbt_kalman_update(filter->mean, filter->covariance, GBT_AXES, observation, std, angle, 0);
}

int gbt_ekf_take(gbt_ekf *filter, const gbt_ekf_settings *settings, const gbt_sighting *sighting)
{
    gbt_polar_rows rows;
    gbt_real mean[D], spread[D][D];
    if (!gbt_can_take(sighting, filter->begun, filter->time)) return 0;
    if (gbt_is_bearing(sighting) && !sighting->stated) return update(filter, settings, sighting);
    if (!filter->begun && !gbt_guess(&settings->guess, filter->known, filter->zero, sighting, mean, spread)) return 0;
    if (!advance(filter, settings, sighting)) return 0;
    gbt_polar_of(sighting, filter->mean, settings->guess.bearing_std, filter->mean[N - 1], &rows);
    gbt_own_velocity(&filter->own, sighting);
    return gbt_polar_update(filter->mean, filter->covariance, &rows, sighting->position, filter->own.velocity, 0);
}

void gbt_ekf_predict(const gbt_ekf *filter, const gbt_ekf_settings *settings, double time, gbt_real *mean,
                     gbt_real *covariance)
{
    const gbt_real t = (gbt_real)(time - filter->time), q = settings->process_noise;
    for (int i = 0; i < D; i++) {
        if (!filter->begun) {
            mean[i] = filter->known ? filter->zero[i] + settings->guess.mean[i] : filter->start[i];
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
