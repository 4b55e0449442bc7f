#include "gbt_plan.h"

#include "gbt_check.h"
#include "gbt_form.h"
#include "gbt_interior.h"
#include "gbt_math.h"
#include "gbt_moments.h"
#include "gbt_places.h"
#include "gbt_worth.h"

enum { N = GBT_PIECES * GBT_FREE };
#define GAINED ((gbt_real)0.25) /* by a round of tightening, at least: more is not made up for */

void gbt_plan_init(gbt_planner *planner)
{
    gbt_default_settings(&planner->settings);
    planner->warm = 0;
#if GBT_SHOOTING
    planner->ready = 0;
#endif
#if GBT_RELATIVE
    for (int j = 0; j < GBT_DIMENSION; j++) planner->origin[j] = 0;
#endif
}

size_t gbt_planner_bytes(void) { return sizeof(gbt_planner); }

/* Of the coordinates of state, means and endpoints. */
static const double *base_of(const gbt_planner *planner)
{
#if GBT_RELATIVE
    return planner->origin;
#else
    static const double zero[GBT_DIMENSION];
    (void)planner;
    return zero;
#endif
}

static gbt_status refuse(gbt_plan_result *plan)
{
    *plan = (gbt_plan_result){0};
    plan->origin = GBT_NO_PLAN;
    plan->violation = GBT_INFINITY;
    for (int i = 0; i < GBT_PIECES; i++) plan->piece_violation[i] = GBT_INFINITY;
    return plan->status = GBT_NOT_FINITE;
}

/* The rest of the previous plan, lengthened by a piece. */
static void shift(const gbt_planner *planner, gbt_real *top)
{
    for (int k = 0; k < N - GBT_FREE; k++) top[k] = (&planner->previous[0][0])[k + GBT_FREE];
    gbt_lengthen(planner->previous[GBT_PIECES - 1], top + N - GBT_FREE);
}

/* The same from a start that is relative to an origin, which is where the previous plan led unless the vehicle was
   pushed: what it is off is led back as the form knows how. */
static void resume(const gbt_planner *planner, const double *origin, const gbt_real *start, gbt_real *top)
{
    gbt_piece first, second;
    gbt_real off[GBT_STATE];
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(first, a) = planner->begin[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(first, a) = planner->previous[0][a];
    gbt_next_piece(first, second);
    for (int a = 0; a < GBT_STATE; a++) off[a] = start[a] - *gbt_inherited(second, a);
    for (int j = 0; j < GBT_DIMENSION; j++) off[j] += (gbt_real)(origin[j] - planner->place[j]);
    shift(planner, top);
    gbt_lead_back(off, GBT_PIECES, top);
}

static int keep(const gbt_real *from, gbt_real *to)
{
    for (int k = 0; k < N; k++) to[k] = from[k];
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

/* Whether the first piece of plan->top keeps what limits can be helped, on thrust or all, and all of it beats braking. */
static int serves(const gbt_planner *planner, const gbt_real *state, const gbt_real *parameters,
                  const gbt_plan_result *plan, int thrust_only)
{
    gbt_real fine[1][GBT_LIMITS + 1];
    gbt_survey(state, &plan->top[0][0], 1, GBT_FINE_POINTS, parameters + GBT_LIMIT_NUMBERS, fine);
    for (int q = 0; q < GBT_LIMITS; q++)
        if (!(thrust_only && gbt_limits[q].kind != GBT_THRUST) && excess_of(planner, plan, q, fine[0][q]) > 0) return 0;
    return gbt_beats_braking(state, &plan->top[0][0], parameters);
}

/* Whether the first piece of a plan can be brought within the thrust and serves then; it is plan->top if so. */
static int mends(const gbt_planner *planner, const gbt_real *state, const gbt_real *parameters, const gbt_real *from,
                 int thrust_only, gbt_plan_result *plan)
{
    gbt_real found[N];
    keep(&plan->top[0][0], found);
    keep(from, &plan->top[0][0]);
    if (gbt_mend(state, &plan->top[0][0]) && serves(planner, state, parameters, plan, thrust_only)) return 1;
    keep(found, &plan->top[0][0]);
    return 0;
}

/* Solves from plan->top within so many iterations. While the piece that is to be executed breaks limits between the
   nodes, these limits are tightened, each by what it was broken, and the problem is solved again. Thrust must be kept in
   the end. Where a round has gained little of it, the solution that breaks it least is mended, or else this one, if that
   keeps all limits: to ask for more would move what has nothing to do with it. Where neither leads to it, nor to an
   iterate that keeps all limits, the one that breaks it least is mended. Another limit is tightened as long as that
   helps, and not where it has been given up already. Returns GBT_SOLVED if plan->top may be executed, and leaves the
   last iterate there at GBT_ITERATION_LIMIT. */
static gbt_status attempt(gbt_planner *planner, const gbt_real *state, const gbt_real *parameters, int warm,
                          int iterations, gbt_plan_result *plan)
{
    const gbt_real *moving = parameters + GBT_LIMIT_NUMBERS;
    const int last = plan->iterations + iterations;
    gbt_settings settings = planner->settings;
    gbt_real u[N], best[N], tightening[GBT_LIMITS + 1], before[GBT_LIMITS + 1];
    gbt_real least = GBT_INFINITY; /* by which the thrust of best is broken between the nodes */
    gbt_status status = GBT_ITERATION_LIMIT;
    for (int q = 0; q < GBT_LIMITS; q++) {
        tightening[q] = 0;
        before[q] = GBT_INFINITY;
    }
    keep(&plan->top[0][0], best);
    for (int k = 0; k < N; k++) u[k] = plan->top[k / GBT_FREE][k % GBT_FREE] / gbt_input_scale[k % GBT_FREE];
    for (int tightened = 0; plan->iterations < last; tightened++) {
        gbt_real fine[1][GBT_LIMITS + 1], nodes[1][GBT_LIMITS + 1];
        gbt_result result;
        gbt_real over = 0;
        int again = 0, stuck = 0;
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
            if (thrust && excess > over) over = excess;
            if (thrust && excess > (1 - GAINED) * before[q]) stuck = 1;
            if (!thrust && gbt_limits[q].hard && nodes[0][q] > settings.feasibility) continue;
            if (!thrust && excess > before[q] / 2) continue;
            /* a little more than was found, over the share that the round before gained of what it was asked for */
            tightening[q] += (gbt_real)1.2 * excess / gbt_fmax(1 - excess / before[q], GAINED) + (gbt_real)1e-4;
            before[q] = excess;
            again = 1;
        }
        if (over > 0) status = GBT_BROKEN_BETWEEN_NODES;
        if (over < least || over <= 0) {
            least = over;
            keep(&plan->top[0][0], best);
        }
        if (stuck && (mends(planner, state, parameters, best, 0, plan) ||
                      mends(planner, state, parameters, &plan->top[0][0], 0, plan)))
            return GBT_SOLVED;
        if (!again || tightened == GBT_TIGHTENINGS) break;
        plan->tightened++;
        warm = GBT_AGAIN;
    }
    if (least == GBT_INFINITY) return status;
    if (least > 0 && status == GBT_ITERATION_LIMIT && serves(planner, state, parameters, plan, 0)) return status;
    keep(best, &plan->top[0][0]);
    if (least <= 0 || mends(planner, state, parameters, best, 1, plan)) return GBT_SOLVED;
    for (int k = 0; k < N; k++) plan->top[k / GBT_FREE][k % GBT_FREE] = u[k] * gbt_input_scale[k % GBT_FREE];
    return status;
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

/* A step from a start that is relative to the origin of the numbers. */
static void plan_from(gbt_planner *planner, const double *origin, const gbt_real *state, gbt_plan_result *plan)
{
    const gbt_real *parameters = planner->numbers, *moving = parameters + GBT_LIMIT_NUMBERS;
    const int deadline = planner->settings.deadline;
    gbt_status found;
    gbt_real unfinished[N];
    int some = 0;
    plan->iterations = plan->tightened = 0;
    gbt_broken_at_start(state, moving, plan->broken_at_start);

    if (planner->warm)
        resume(planner, origin, state, &plan->top[0][0]);
    else
        gbt_coast(state, GBT_ASIDE, &plan->top[0][0]);
    /* a warm attempt leaves a third of the iterations to a cold one */
    plan->status = found = attempt(planner, state, parameters, planner->warm,
                                   planner->warm ? deadline - deadline / 3 : deadline, plan);
    plan->origin = GBT_PLANNED;
    if (found == GBT_ITERATION_LIMIT) {
        /* Nearer to a solution than what it started from, and so is the next step that starts from it. */
        some = keep(&plan->top[0][0], unfinished);
        if (serves(planner, state, parameters, plan, 0)) {
            plan->origin = GBT_UNFINISHED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        resume(planner, origin, state, &plan->top[0][0]);
        if (serves(planner, state, parameters, plan, 0)) {
            plan->origin = GBT_SHIFTED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        gbt_coast(state, GBT_ASIDE, &plan->top[0][0]);
        plan->origin = GBT_COLD;
        found = attempt(planner, state, parameters, 0, deadline - plan->iterations, plan);
        if (found == GBT_ITERATION_LIMIT && !some) some = keep(&plan->top[0][0], unfinished);
    }
    if (found != GBT_SOLVED && some) {
        keep(unfinished, &plan->top[0][0]);
        if (serves(planner, state, parameters, plan, 1) || mends(planner, state, parameters, unfinished, 1, plan)) {
            plan->origin = GBT_UNFINISHED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED && planner->warm) {
        resume(planner, origin, state, &plan->top[0][0]);
        if (mends(planner, state, parameters, &plan->top[0][0], 1, plan)) {
            plan->origin = GBT_SHIFTED;
            found = GBT_SOLVED;
        }
    }
    if (found != GBT_SOLVED) {
        plan->origin = GBT_BRAKED;
        gbt_brake(state, &plan->top[0][0]);
    }

    judge(planner, state, moving, plan);
    gbt_fill_plan(state, parameters, plan);
}

static int is_finite(const gbt_plan_result *plan)
{
    return isfinite(plan->objective) && gbt_all_finite(&plan->top[0][0], N) &&
           gbt_all_finite(&plan->endpoints[0][0], GBT_PIECES * GBT_FLAT) &&
           gbt_all_finite(&plan->rates[0][0], GBT_PIECES * GBT_FLAT) &&
           gbt_all_finite(&plan->thrust[0][0][0], GBT_PIECES * GBT_PROFILE * GBT_INPUTS);
}

/* Keeps a plan from a start relative to an origin as the previous one, and gives its endpoints in the coordinates of the
   state. */
static gbt_status remember(gbt_planner *planner, const double *origin, const gbt_real *start, gbt_plan_result *plan)
{
    for (int k = 0; k < N; k++) planner->previous[k / GBT_FREE][k % GBT_FREE] = plan->top[k / GBT_FREE][k % GBT_FREE];
    planner->warm = 1;
    for (int j = 0; j < GBT_DIMENSION; j++) planner->place[j] = origin[j];
    for (int a = 0; a < GBT_STATE; a++) planner->begin[a] = start[a];
#if GBT_SHOOTING
    planner->ready = 0;
#endif
    for (int i = 0; i < GBT_PIECES; i++)
        for (int j = 0; j < GBT_DIMENSION; j++)
            plan->endpoints[i][j] = (gbt_real)(origin[j] - base_of(planner)[j] + (double)plan->endpoints[i][j]);
    return plan->status;
}

/* Refuses what is not finite, or is so large that nothing finite comes of it, and remembers nothing of that. */
static gbt_status plan_relative(gbt_planner *planner, const double *origin, const gbt_real *start,
                                gbt_plan_result *plan)
{
    if (!gbt_all_finite(start, GBT_STATE) || !gbt_all_finite(planner->numbers, GBT_NUMBERS)) return refuse(plan);
    plan_from(planner, origin, start, plan);
    if (!is_finite(plan)) return refuse(plan);
    return remember(planner, origin, start, plan);
}

/* planner->numbers from the parameters. */
static void place_all(gbt_planner *planner, const double *origin, const double *parameters)
{
    gbt_place_ends(origin, parameters, GBT_PIECES, planner->numbers);
    gbt_place_knots(origin, parameters + GBT_PIECES * GBT_PARAMETERS, GBT_PIECES + 1,
                    planner->numbers + GBT_LIMIT_NUMBERS);
}

gbt_status gbt_plan_parameters(gbt_planner *planner, const gbt_real *state, const double *parameters,
                               gbt_plan_result *plan)
{
    double origin[GBT_DIMENSION];
    gbt_real start[GBT_STATE];
    gbt_begin(base_of(planner), state, origin, start);
    place_all(planner, origin, parameters);
    return plan_relative(planner, origin, start, plan);
}

#if GBT_MOMENTS
/* Here already: the root of a covariance takes what is not a positive eigenvalue for zero. */
static int moments_are_finite(const gbt_real *mean, const gbt_real *covariance, const gbt_real *desired)
{
    enum { BOUNDARIES = GBT_PIECES + GBT_PRESENT };
    return gbt_all_finite(mean, BOUNDARIES * GBT_DIMENSION) &&
           gbt_all_finite(covariance, BOUNDARIES * GBT_DIMENSION * GBT_DIMENSION) &&
           gbt_all_finite(desired, GBT_PIECES * GBT_DIMENSION);
}

gbt_status gbt_plan(gbt_planner *planner, const gbt_real *state, const gbt_real *mean, const gbt_real *covariance,
                    const gbt_real *desired, gbt_plan_result *plan)
{
    double origin[GBT_DIMENSION];
    gbt_real start[GBT_STATE];
    if (!moments_are_finite(mean, covariance, desired)) return refuse(plan);
    gbt_begin(base_of(planner), state, origin, start);
    gbt_bind(base_of(planner), origin, mean, covariance, desired, planner->numbers);
    return plan_relative(planner, origin, start, plan);
}
#endif

#if GBT_SHOOTING
#include "gbt_shoot_time.h"
#endif
