#include "gbt_shape_fit.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_COORDINATES
#define SETTLED ((gbt_real)0.1)        /* decrease that a step promises, below which a motion has settled */
#define MOST_RANGE ((gbt_real)1)       /* largest step of log range and log speed, */
#define MOST_DIRECTION ((gbt_real)0.4) /* of the direction, rad, */
#define MOST_HEADING ((gbt_real)0.8)   /* and of the heading */
#define LOG_TWO_PI ((gbt_real)1.8378770664093453)

/* Factor in (0, 1] that keeps a step within its limits. */
static gbt_real shortening(const gbt_shape_prior *prior, const gbt_real *step)
{
    gbt_real most = gbt_fmax(1, gbt_fabs(step[0]) * prior->log_range_std / MOST_RANGE);
    for (int a = 0; a < GBT_AXES; a++) most = gbt_fmax(most, GBT_FLAT_ANGLE * gbt_fabs(step[1 + a]) / MOST_DIRECTION);
    most = gbt_fmax(most, gbt_fabs(step[GBT_SPEED_AT]) * prior->log_speed_std / MOST_RANGE);
    return 1 / gbt_fmax(most, GBT_FLAT_ANGLE * gbt_fabs(step[GBT_HEADING_AT]) / MOST_HEADING);
}

/* Ranges where a fit began; 0 where they make no difference. */
static const gbt_real *ranges_of(const gbt_fitted *fitted)
{
#if GBT_OWN_NOISE
    return fitted->range;
#else
    (void)fitted;
    return 0;
#endif
}

/* Newton's step from where a motion is, and what it promises; a motion without one is impossible. */
static void newton(gbt_walk *on, const gbt_shape_prior *prior, gbt_fitted *fitted, gbt_normal *normal)
{
    gbt_real gradient[N];
    on->range = ranges_of(fitted);
    on->normal = normal;
    gbt_walk_along(on, prior, &fitted->at);
    fitted->objective = on->objective;
    fitted->recent = gbt_recent_residual(on);
    fitted->log_evidence = on->log_determinant; /* of the bearings' noise, until the fit ends */
    fitted->decrement = fitted->log_determinant = 0;
    const int sound = gbt_factor_lower(normal->precision, N);
    for (int j = 0; j < N; j++) fitted->step[j] = gradient[j] = sound ? normal->gradient[j] : 0;
    if (!sound) fitted->objective = GBT_INFINITY;
    if (!sound) return;
    gbt_solve_lower(normal->precision, N, fitted->step);
    gbt_solve_upper(normal->precision, N, fitted->step);
    for (int j = 0; j < N; j++) {
        fitted->decrement += fitted->step[j] * gradient[j];
        fitted->log_determinant += 2 * gbt_log(normal->precision[GBT_ROW_BEGIN(j) + j]);
        gradient[j] = j == 0;
    }
    const gbt_real factor = shortening(prior, fitted->step);
    for (int j = 0; j < N; j++) fitted->step[j] *= factor;
    gbt_solve_lower(normal->precision, N, gradient);
    fitted->variance = 0;
    for (int j = 0; j < N; j++) fitted->variance += gradient[j] * gradient[j];
}

#if GBT_OWN_NOISE
/* Ranges of the bins where a fit begins. */
static void note_ranges(gbt_walk *on, const gbt_shape_prior *prior, gbt_fitted *fitted)
{
    const gbt_seen *seen = on->seen;
    gbt_course course;
    gbt_real before[D], line[D];
    gbt_course_begin(&course, 0, prior, &fitted->at, 0);
    for (int k = 0; k < seen->spots;) {
        for (int i = 0; i < D; i++) before[i] = course.position[i];
        gbt_course_next(&course, 0, prior, &fitted->at);
        for (; k < seen->spots && seen->spot[k].left < course.node; k++) {
            const gbt_spot *spot = &seen->spot[k];
            if (spot->what != GBT_SEES_BEARING) continue;
            for (int i = 0; i < D; i++)
                line[i] = (1 - spot->share) * before[i] + spot->share * course.position[i] - seen->own[spot->number][i];
            fitted->range[spot->number] = gbt_length(line);
        }
    }
}
#endif

void gbt_shape_fit(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_seen *seen, gbt_fitted *fitted,
                   int count, int iterations, gbt_walk *on, gbt_normal *normal)
{
    on->noise = noise;
    on->seen = seen;
    for (int b = 0; b < count; b++) {
#if GBT_OWN_NOISE
        note_ranges(on, prior, &fitted[b]);
#endif
        newton(on, prior, &fitted[b], normal);
    }
    for (int taken = 0; taken < iterations; taken++) {
        gbt_real most = 0;
        for (int b = 0; b < count; b++) most = gbt_fmax(most, fitted[b].decrement);
        if (!(most > SETTLED)) break;
        for (int b = 0; b < count; b++) {
            gbt_motion candidate;
            gbt_motion_move(&fitted[b].at, fitted[b].step, &candidate);
            on->range = ranges_of(&fitted[b]);
            on->normal = 0;
            gbt_walk_along(on, prior, &candidate);
            if (on->objective <= fitted[b].objective + (gbt_real)1e-9) {
                fitted[b].at = candidate;
                newton(on, prior, &fitted[b], normal);
            } else {
                for (int j = 0; j < N; j++) fitted[b].step[j] /= 4;
            }
        }
    }
    for (int b = 0; b < count; b++) {
        gbt_fitted *one = &fitted[b];
        /* what is left is too small to bend anything: the last step is taken without looking again */
        const int last = one->decrement <= SETTLED;
        for (int j = 0; !last && j < N; j++) one->step[j] = 0;
        const gbt_real rows = (gbt_real)(GBT_AXES * seen->bins + seen->others);
        const gbt_real noise_determinant = GBT_AXES * one->log_evidence + seen->others_log_determinant;
        one->log_evidence = -(one->objective - (last ? one->decrement : 0) + one->log_determinant + noise_determinant +
                              rows * LOG_TWO_PI) / 2;
    }
}

void gbt_shape_factor(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_seen *seen,
                      const gbt_fitted *fitted, gbt_walk *on, gbt_normal *normal)
{
    on->noise = noise;
    on->seen = seen;
    on->range = ranges_of(fitted);
    on->normal = normal;
    gbt_walk_along(on, prior, &fitted->at);
    gbt_factor_lower(normal->precision, N);
}
