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

static int keep(gbt_real from[GBT_PIECES][GBT_FREE], gbt_real to[GBT_PIECES][GBT_FREE])
{
    for (int i = 0; i < GBT_PIECES; i++)
        for (int a = 0; a < GBT_FREE; a++) to[i][a] = from[i][a];
    return 1;
}

/* How far a judged limit is broken in the first piece beyond what cannot be helped: beyond the start where that has
   broken it already. Limits besides thrust count as kept up to what the solver takes for kept. */
static gbt_real excess_of(const gbt_planner *planner, const gbt_plan_result *plan, int q, gbt_real fine)
{
    gbt_real allowed = gbt_limits[q].kind == GBT_THRUST ? 0 : planner->settings.feasibility;
    if (!gbt_limits[q].judged) return 0;
    if (plan->broken_at_start[q] > allowed) allowed = plan->broken_at_start[q];
    return fine > allowed ? fine - allowed : 0;
}

/* Whether the first piece of plan->top keeps the limits but for what cannot be helped: those on thrust, or all. */
static int keeps_limits(const gbt_planner *planner, const gbt_real *state, const gbt_real *moving,
                        const gbt_plan_result *plan, int thrust_only)
{
    gbt_real fine[1][GBT_LIMITS + 1];
    gbt_survey(state, &plan->top[0][0], 1, GBT_FINE_POINTS, moving, fine);
    for (int q = 0; q < GBT_LIMITS; q++)
        if (!(thrust_only && gbt_limits[q].kind != GBT_THRUST) && excess_of(planner, plan, q, fine[0][q]) > 0) return 0;
    return 1;
}

/* Solves from plan->top within so many iterations. While the piece that is to be executed breaks limits between the
   nodes, these limits are tightened, each by what it was broken, and the problem is solved again. Thrust must be kept in
   the end. Another limit is tightened as long as that helps, and not where it has been given up already. Returns
   GBT_SOLVED if plan->top may be executed, and leaves the last iterate there at GBT_ITERATION_LIMIT. */
static gbt_status attempt(gbt_planner *planner, const gbt_real *state, const gbt_real *parameters, int warm,
                          int iterations, gbt_plan_result *plan)
{
    const gbt_real *moving = parameters + GBT_LIMIT_NUMBERS;
    const int last = plan->iterations + iterations;
    gbt_settings settings = planner->settings;
    gbt_real u[N], usable[N], tightening[GBT_LIMITS + 1], before[GBT_LIMITS + 1];
    int found = 0;
    gbt_status status = GBT_ITERATION_LIMIT;
    for (int q = 0; q < GBT_LIMITS; q++) {
        tightening[q] = 0;
        before[q] = GBT_INFINITY;
    }
    for (int k = 0; k < N; k++) u[k] = plan->top[k / GBT_FREE][k % GBT_FREE] / gbt_input_scale[k % GBT_FREE];
    for (int tightened = 0; plan->iterations < last; tightened++) {
        gbt_real fine[1][GBT_LIMITS + 1], nodes[1][GBT_LIMITS + 1];
        gbt_result result;
        int again = 0, kept = 1;
        settings.deadline = last - plan->iterations;
        status = gbt_solve(&settings, state, parameters, tightening, warm, u, &planner->work, &result);
        plan->iterations += result.iterations;
        if (status != GBT_NUMERICAL_FAILURE)
            for (int k = 0; k < N; k++) plan->top[k / GBT_FREE][k % GBT_FREE] = u[k] * gbt_input_scale[k % GBT_FREE];
        if (status != GBT_SOLVED && status != GBT_GIVEN_UP) break;
        gbt_survey(state, &plan->top[0][0], 1, GBT_FINE_POINTS, moving, fine);
        gbt_survey(state, &plan->top[0][0], 1, GBT_NODES, moving, nodes);
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_real excess = excess_of(planner, plan, q, fine[0][q]);
            const int thrust = gbt_limits[q].kind == GBT_THRUST;
            if (excess <= 0) continue;
            if (thrust) kept = 0;
            if (!thrust && gbt_limits[q].hard && nodes[0][q] > settings.feasibility) continue;
            if (!thrust && excess > before[q] / 2) continue;
            before[q] = excess;
            /* a little more than was found, so that one round nearly always does it */
            tightening[q] += (gbt_real)1.2 * excess + (gbt_real)1e-4;
            again = 1;
        }
        if (kept) {
            found = 1;
            for (int k = 0; k < N; k++) usable[k] = plan->top[k / GBT_FREE][k % GBT_FREE];
        } else {
            status = GBT_BROKEN_BETWEEN_NODES;
        }
        if (!again || tightened == GBT_TIGHTENINGS) break;
        plan->tightened++;
        warm = GBT_AGAIN;
    }
    if (!found) return status;
    for (int k = 0; k < N; k++) plan->top[k / GBT_FREE][k % GBT_FREE] = usable[k];
    return GBT_SOLVED;
}

/* What the limits say of plan->top: worst of each piece, and which of them had to give. */
static void judge(const gbt_planner *planner, const gbt_real *state, const gbt_real *moving, gbt_plan_result *plan)
{
    gbt_real fine[GBT_PIECES][GBT_LIMITS + 1], nodes[GBT_PIECES][GBT_LIMITS + 1];
    gbt_survey(state, &plan->top[0][0], GBT_PIECES, GBT_FINE_POINTS, moving, fine);
    gbt_survey(state, &plan->top[0][0], GBT_PIECES, GBT_NODES, moving, nodes);
    plan->violation = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        plan->piece_violation[i] = 0;
        for (int q = 0; q < GBT_LIMITS; q++)
            if (gbt_limits[q].judged && fine[i][q] > plan->piece_violation[i]) plan->piece_violation[i] = fine[i][q];
        if (plan->piece_violation[i] > plan->violation) plan->violation = plan->piece_violation[i];
    }
    for (int q = 0; q < GBT_LIMITS; q++) {
        gbt_real worst = 0;
        int gave = excess_of(planner, plan, q, fine[0][q]) > 0;
        for (int i = 0; i < GBT_PIECES; i++) {
            if (gbt_limits[q].hard && nodes[i][q] > planner->settings.feasibility) gave = 1;
            if (fine[i][q] > worst) worst = fine[i][q];
        }
        plan->given_up[q] = gave && gbt_limits[q].kind != GBT_THRUST ? worst : 0;
        if (plan->given_up[q] > 0 && plan->status == GBT_SOLVED) plan->status = GBT_GIVEN_UP;
    }
}

/* All else that follows from plan->top. */
static void complete(const gbt_real *state, const gbt_real *parameters, gbt_plan_result *plan)
{
    gbt_real piece[GBT_ORDERS][GBT_FLAT], next[GBT_ORDERS][GBT_FLAT], point[GBT_POINT], term;
    plan->objective = 0;
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
    }
}

gbt_status gbt_plan_parameters(gbt_planner *planner, const gbt_real *state, const gbt_real *parameters,
                               gbt_plan_result *plan)
{
    const gbt_real *moving = parameters + GBT_LIMIT_NUMBERS;
    const int deadline = planner->settings.deadline;
    gbt_status found;
    gbt_real unfinished[GBT_PIECES][GBT_FREE];
    int some = 0;
    if (!all_finite(state, GBT_STATE) || !all_finite(parameters, GBT_NUMBERS)) return refuse(plan);
    plan->iterations = plan->tightened = 0;
    gbt_broken_at_start(state, moving, plan->broken_at_start);

    if (planner->warm)
        shift(planner, plan->top);
    else
        coast(state, plan->top);
    /* a warm attempt leaves a third of the iterations to a cold one */
    plan->status = found = attempt(planner, state, parameters, planner->warm,
                                   planner->warm ? deadline - deadline / 3 : deadline, plan);
    plan->origin = GBT_PLANNED;
    if (found == GBT_ITERATION_LIMIT) {
        /* Nearer to a solution than what it started from, and so is the next step that starts from it. */
        some = keep(plan->top, unfinished);
        if (keeps_limits(planner, state, moving, plan, 0)) {
            plan->origin = GBT_UNFINISHED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        /* From where the vehicle really is, which is where the previous plan led unless it was pushed. */
        shift(planner, plan->top);
        if (keeps_limits(planner, state, moving, plan, 0)) {
            plan->origin = GBT_SHIFTED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        coast(state, plan->top);
        plan->origin = GBT_COLD;
        found = attempt(planner, state, parameters, 0, deadline - plan->iterations, plan);
        if (found == GBT_ITERATION_LIMIT && !some) some = keep(plan->top, unfinished);
    }
    if (found != GBT_SOLVED && some) {
        keep(unfinished, plan->top);
        if (keeps_limits(planner, state, moving, plan, 1)) {
            plan->origin = GBT_UNFINISHED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED) {
        plan->origin = GBT_BRAKED;
        gbt_brake(state, &plan->top[0][0]);
    }

    for (int k = 0; k < N; k++) planner->previous[k / GBT_FREE][k % GBT_FREE] = plan->top[k / GBT_FREE][k % GBT_FREE];
    planner->warm = 1;
    judge(planner, state, moving, plan);
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
