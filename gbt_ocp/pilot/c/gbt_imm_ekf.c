#include "gbt_imm_ekf.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define FILTER_WINDOW 100 /* measurements that count as the window of a filter */

static const gbt_own_velocities unmoved;

/* A track that has seen nothing. */
static void begin(gbt_imm_ekf *filter, int known, const gbt_real *start)
{
    filter->begun = 0;
    filter->time = 0;
    filter->known = known;
    filter->own = unmoved;
    for (int k = 0; k < D; k++) filter->start[k] = start[k];
}

void gbt_imm_ekf_begin(gbt_imm_ekf *filter, int known, const gbt_real *start, const gbt_real *zero)
{
    gbt_gaps_init(&filter->gaps, 0, FILTER_WINDOW);
    for (int k = 0; k < D; k++) filter->zero[k] = zero[k];
    begin(filter, known, start);
}

void gbt_imm_ekf_shift(gbt_imm_ekf *filter, const gbt_real *way)
{
    for (int k = 0; k < D; k++) {
        filter->start[k] -= way[k];
        filter->zero[k] -= way[k];
        for (int m = 0; m < GBT_MODES; m++) filter->models.mean[m][k] -= way[k];
        for (int s = 0; s <= GBT_SENSORS; s++) filter->own.position[s][k] -= way[k];
    }
}

void gbt_imm_ekf_take(gbt_imm_ekf *filter, const gbt_imm_ekf_settings *settings, const gbt_sighting *sighting)
{
    gbt_real mean[D], spread[D][D], log_likelihood[GBT_MODES];
    gbt_polar_rows rows;
    /* a track begins with a bearing, or where its position is known */
    if (!filter->begun && !gbt_guess(&settings->guess, filter->known, filter->zero, sighting, mean, spread)) return;
    if (gbt_gap_ended(&filter->gaps, sighting->time)) begin(filter, 0, sighting->position);
    if (filter->begun) {
        gbt_imm_advance(&filter->models, &settings->models, (gbt_real)(sighting->time - filter->time));
    } else {
        if (!gbt_guess(&settings->guess, filter->known, filter->zero, sighting, mean, spread)) return;
        gbt_imm_begin(&filter->models, &settings->models, mean, spread);
        filter->begun = 1;
    }
    filter->time = sighting->time;
    gbt_own_velocity(&filter->own, sighting);
    for (int m = 0; m < GBT_MODES; m++) {
        gbt_real *state = filter->models.mean[m];
        gbt_polar_of(sighting, state, settings->guess.bearing_std, state[GBT_N - 1], &rows);
        if (!gbt_polar_update(state, filter->models.covariance[m], &rows, sighting->position, filter->own.velocity,
                              &log_likelihood[m]))
            log_likelihood[m] = -GBT_INFINITY;
    }
    gbt_imm_weigh(&filter->models, log_likelihood);
}

void gbt_imm_ekf_predict(const gbt_imm_ekf *filter, const gbt_imm_ekf_settings *settings, double time, gbt_real *mean,
                         gbt_real *covariance)
{
    if (filter->begun) {
        gbt_imm_forecast(&filter->models, &settings->models, (gbt_real)(time - filter->time), mean, covariance);
        return;
    }
    for (int i = 0; i < D; i++) {
        mean[i] = filter->known ? filter->zero[i] + settings->guess.mean[i] : filter->start[i];
        for (int j = 0; j < D; j++) covariance[i * D + j] = (gbt_real)NAN;
    }
}
