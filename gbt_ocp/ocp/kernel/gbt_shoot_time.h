/* The two parts of a step in real time; a part of gbt_plan.c, whose functions it shares. */
#ifndef GBT_SHOOT_TIME_H
#define GBT_SHOOT_TIME_H

#include "gbt_slacks.h"

#define MU_IN_TIME ((gbt_real)1e-3) /* of these iterations: small ones let the active limits change too slowly */
#define MORE 2 /* iterations after that, with the state in hand */

gbt_status gbt_plan_prepare(gbt_planner *planner)
{
    gbt_workspace *work = &planner->work;
    gbt_real *moving = planner->numbers + GBT_LIMIT_NUMBERS, top[N];
    gbt_piece first;
    if (planner->ready) return GBT_SOLVED;
    if (!planner->warm) return GBT_NUMERICAL_FAILURE;

    for (int a = 0; a < GBT_STATE; a++) first[a] = planner->begin[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(first, a) = planner->previous[0][a];
    gbt_next_piece(first, work->piece[0]);
    shift(planner, top);
    for (int k = 0; k < N; k++) *gbt_free(work->piece[k / GBT_FREE], k % GBT_FREE) = top[k];
    gbt_propagate(work->piece, GBT_PIECES);
    /* the forecast one piece later, its last part again */
    for (int k = 0; k < (GBT_PIECES - 1) * GBT_END_NUMBERS; k++)
        planner->numbers[k] = planner->numbers[k + GBT_END_NUMBERS];
    for (int k = 0; k < GBT_PIECES * GBT_KNOT_NUMBERS; k++) moving[k] = moving[k + GBT_KNOT_NUMBERS];

    work->first = 0;
    work->pieces = GBT_PIECES;
    work->count = GBT_COUNT;
    work->parameters = planner->numbers;
    work->moving = moving;
    for (int q = 0; q < GBT_LIMITS; q++) work->tightening[q] = 0;
    gbt_weigh_limits(work, planner->settings.limit_weight, planner->settings.limit_weight);
    planner->ready = gbt_make_ready(work, MU_IN_TIME);
    return planner->ready ? GBT_SOLVED : GBT_NUMERICAL_FAILURE;
}

/* Within the bounds of the inputs, where nothing else bounds the trajectory. */
static gbt_status more_iterations(gbt_planner *planner, gbt_result *result)
{
    gbt_workspace *work = &planner->work;
#if GBT_BOX >= 0
    const gbt_status status = gbt_minimise_in_box(&planner->settings, MORE, work, result);
    if (status != GBT_LIMIT_VIOLATED) return status;
#endif
    return gbt_minimise(planner->settings.tolerance, MU_IN_TIME, gbt_last_barrier(&planner->settings), GBT_INFINITY,
                        MORE, work, result);
}

/* One Newton step from what is prepared, for a start and the present numbers, and a few iterations more. What has not
   converged by then has to serve better than braking, as an unfinished plan of a whole step has. */
static gbt_status feedback(gbt_planner *planner, const gbt_real *start, gbt_plan_result *plan)
{
    gbt_workspace *work = &planner->work;
    gbt_real *moving = planner->numbers + GBT_LIMIT_NUMBERS, change[GBT_STATE];
    if (!gbt_all_finite(start, GBT_STATE) || !gbt_all_finite(planner->numbers, GBT_NUMBERS)) return refuse(plan);
    for (int a = 0; a < GBT_STATE; a++) change[a] = start[a] - work->piece[0][a];
    gbt_objective_slopes(work);
    gbt_lagrangian_gradient(work, work->step_of.target);
    gbt_step_from(work, work->pull, change);

    for (int a = 0; a < GBT_STATE; a++) work->trial[0][a] = start[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_follow_gains(work, i, 1, work->trial[i], gbt_free(work->trial[i], 0));
        gbt_admit(work->trial[i]);
        gbt_next_piece(work->trial[i], work->trial[i + 1]);
    }
    for (int i = 0; i < GBT_PIECES; i++)
        for (int a = 0; a < GBT_PIECE; a++) work->piece[i][a] = work->trial[i][a];
    gbt_propagate(work->piece, GBT_PIECES);
    gbt_result more;
    more.iterations = 1;
    plan->status = more_iterations(planner, &more);
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_admit(work->piece[i]);
#if GBT_LAST < GBT_STATES
        gbt_next_piece(work->piece[i], work->piece[i + 1]);
#endif
        for (int a = 0; a < GBT_FREE; a++) plan->top[i][a] = *gbt_free(work->piece[i], a);
    }
    plan->origin = GBT_PLANNED;
    if (plan->status == GBT_SOLVED || gbt_beats_braking(start, &plan->top[0][0], planner->numbers)) {
        plan->status = GBT_SOLVED;
    } else {
        plan->origin = GBT_BRAKED;
        gbt_brake(start, &plan->top[0][0]);
    }
    plan->iterations = more.iterations;
    plan->tightened = 0;
    gbt_broken_at_start(start, moving, plan->broken_at_start);
    judge(planner, start, moving, plan);
    gbt_fill_plan(start, planner->numbers, plan);
    if (!is_finite(plan)) return refuse(plan);
    double origin[GBT_DIMENSION];
    for (int j = 0; j < GBT_DIMENSION; j++) origin[j] = planner->place[j];
    return remember(planner, origin, start, plan);
}

/* The state relative to the place of the previous plan. */
static void begin_there(const gbt_planner *planner, const gbt_real *state, gbt_real *start)
{
    for (int a = 0; a < GBT_STATE; a++) start[a] = state[a];
    for (int j = 0; j < GBT_DIMENSION; j++)
        start[j] = (gbt_real)(base_of(planner)[j] + (double)state[j] - planner->place[j]);
}

gbt_status gbt_plan_feedback_parameters(gbt_planner *planner, const gbt_real *state, const double *parameters,
                                        gbt_plan_result *plan)
{
    gbt_real start[GBT_STATE];
    if (!planner->ready) return gbt_plan_parameters(planner, state, parameters, plan);
    planner->ready = 0;
    begin_there(planner, state, start);
    place_all(planner, planner->place, parameters);
    return feedback(planner, start, plan);
}

#if GBT_MOMENTS
gbt_status gbt_plan_feedback(gbt_planner *planner, const gbt_real *state, const gbt_real *mean,
                             const gbt_real *covariance, const gbt_real *desired, gbt_plan_result *plan)
{
    gbt_real start[GBT_STATE];
    if (!planner->ready) return gbt_plan(planner, state, mean, covariance, desired, plan);
    planner->ready = 0;
    if (!moments_are_finite(mean, covariance, desired)) return refuse(plan);
    begin_there(planner, state, start);
    gbt_bind(base_of(planner), planner->place, mean, covariance, desired, planner->numbers);
    return feedback(planner, start, plan);
}
#endif

#endif
