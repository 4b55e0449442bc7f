#include "gbt_plan.h"

#include "gbt_braking.h"
#include "gbt_check.h"
#include "gbt_math.h"
#include "gbt_moments.h"
#include "gbt_pieces.h"

enum { N = GBT_PIECES * GBT_FREE };

void gbt_plan_init(gbt_planner *planner)
{
    gbt_default_settings(&planner->settings);
    planner->warm = 0;
}

size_t gbt_planner_bytes(void) { return sizeof(gbt_planner); }

static int all_finite(const gbt_real *x, int count)
{
    for (int k = 0; k < count; k++)
        if (!isfinite(x[k])) return 0;
    return 1;
}

static gbt_status refuse(gbt_plan_result *plan)
{
    static const gbt_plan_result nothing;
    *plan = nothing;
    plan->origin = GBT_NO_PLAN;
    plan->violation = GBT_INFINITY;
    return plan->status = GBT_NOT_FINITE;
}

/* The rest of the previous plan, its last piece coasting. */
static void shift(const gbt_planner *planner, gbt_real top[GBT_PIECES][GBT_FREE])
{
    for (int i = 0; i < GBT_PIECES; i++)
        for (int a = 0; a < GBT_FREE; a++) top[i][a] = i + 1 < GBT_PIECES ? planner->previous[i + 1][a] : 0;
}

/* Constant velocity, a higher derivative brought to zero within the first piece. */
static void coast(const gbt_real *state, gbt_real top[GBT_PIECES][GBT_FREE])
{
    for (int i = 0; i < GBT_PIECES; i++)
        for (int a = 0; a < GBT_FREE; a++)
            top[i][a] =
                i == 0 && a < GBT_FLAT && GBT_JOINED > 2 ? -state[GBT_STATE - GBT_FLAT + a % GBT_FLAT] / GBT_PERIOD : 0;
}

/* Solves from plan->top, and tightens the limits while the piece that is to be executed breaks them between the nodes.
   Returns GBT_SOLVED if plan->top may be executed. */
static gbt_status attempt(gbt_planner *planner, const gbt_real *state, const gbt_real *parameters,
                          int warm, gbt_plan_result *plan)
{
    gbt_real u[N], tightening = 0;
    for (int k = 0; k < N; k++) u[k] = plan->top[k / GBT_FREE][k % GBT_FREE] / gbt_input_scale[k % GBT_FREE];
    for (int tightened = 0;; tightened++) {
        gbt_result result;
        gbt_solve(&planner->settings, state, parameters, tightening, warm, u, &planner->work, &result);
        plan->iterations += result.iterations;
        if (result.status != GBT_SOLVED) return result.status;
        for (int k = 0; k < N; k++) plan->top[k / GBT_FREE][k % GBT_FREE] = u[k] * gbt_input_scale[k % GBT_FREE];
        gbt_check(state, &plan->top[0][0], GBT_PIECES, GBT_FINE_POINTS, parameters + GBT_LIMIT_NUMBERS,
                  plan->piece_violation);
        if (plan->piece_violation[0] <= 0) return GBT_SOLVED;
        if (tightened == GBT_TIGHTENINGS) return GBT_BROKEN_BETWEEN_NODES;
        plan->tightened++;
        /* a little more than was found, so that one round nearly always does it */
        tightening += (gbt_real)1.2 * plan->piece_violation[0] + (gbt_real)1e-4;
        warm = 1;
    }
}

/* All that follows from plan->top. */
static void complete(const gbt_real *state, const gbt_real *parameters, gbt_plan_result *plan)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], next[GBT_ORDERS][GBT_FLAT], point[GBT_POINT], term;
    gbt_check(state, &plan->top[0][0], GBT_PIECES, GBT_FINE_POINTS, parameters + GBT_LIMIT_NUMBERS,
                  plan->piece_violation);
    plan->objective = plan->violation = 0;
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = state[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = plan->top[i][a];
        for (int k = 0; k < GBT_PROFILE; k++) {
            gbt_point_after(piece, GBT_PERIOD * (gbt_real)k / (GBT_PROFILE - 1), point);
            gbt_vehicle_inputs(point, 0, 0, plan->thrust[i][k]);
        }
        gbt_objective.value(point, parameters + i * GBT_PARAMETERS, 0, &term);
        plan->objective += term;
        gbt_next_piece(piece, next);
        for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = next[a / GBT_FLAT][a % GBT_FLAT];
        for (int j = 0; j < GBT_FLAT; j++) {
            plan->endpoints[i][j] = next[0][j];
            plan->rates[i][j] = next[1][j];
        }
        if (plan->piece_violation[i] < 0) plan->piece_violation[i] = 0;
        if (plan->piece_violation[i] > plan->violation) plan->violation = plan->piece_violation[i];
    }
}

gbt_status gbt_plan_parameters(gbt_planner *planner, const gbt_real *state, const gbt_real *parameters,
                               gbt_plan_result *plan)
{
    gbt_status found;
    if (!all_finite(state, GBT_STATE) || !all_finite(parameters, GBT_NUMBERS)) return refuse(plan);
    plan->iterations = plan->tightened = 0;

    if (planner->warm)
        shift(planner, plan->top);
    else
        coast(state, plan->top);
    plan->status = found = attempt(planner, state, parameters, planner->warm, plan);
    plan->origin = GBT_PLANNED;
    if (found != GBT_SOLVED && planner->warm) {
        /* From where the vehicle really is, which is where the previous plan led unless it was pushed. */
        shift(planner, plan->top);
        gbt_check(state, &plan->top[0][0], GBT_PIECES, GBT_FINE_POINTS, parameters + GBT_LIMIT_NUMBERS,
                  plan->piece_violation);
        if (plan->piece_violation[0] <= 0) {
            plan->origin = GBT_SHIFTED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        coast(state, plan->top);
        plan->origin = GBT_COLD;
        found = attempt(planner, state, parameters, 0, plan);
    }
    if (found != GBT_SOLVED) {
        plan->origin = GBT_BRAKED;
        gbt_brake(state, parameters + GBT_LIMIT_NUMBERS, &plan->top[0][0]);
    }

    for (int k = 0; k < N; k++) planner->previous[k / GBT_FREE][k % GBT_FREE] = plan->top[k / GBT_FREE][k % GBT_FREE];
    planner->warm = 1;
    complete(state, parameters, plan);
    return plan->status;
}

#if GBT_MOMENTS
gbt_status gbt_plan(gbt_planner *planner, const gbt_real *state, const gbt_real *mean, const gbt_real *covariance,
                    const gbt_real *desired, gbt_plan_result *plan)
{
    enum { BOUNDARIES = GBT_PIECES + GBT_PRESENT };
    /* here already: the root of a covariance takes what is not a positive eigenvalue for zero */
    if (!all_finite(mean, BOUNDARIES * GBT_DIMENSION) ||
        !all_finite(covariance, BOUNDARIES * GBT_DIMENSION * GBT_DIMENSION) ||
        !all_finite(desired, GBT_PIECES * GBT_DIMENSION))
        return refuse(plan);
    gbt_bind(mean, covariance, desired, planner->parameters);
    return gbt_plan_parameters(planner, state, planner->parameters, plan);
}
#endif
