/* A primal-dual interior-point method on an elastic form of the limits.

   Every limit may be violated at a price (gbt_slacks.h), so every trajectory is feasible for the program that is
   solved: each iterate can be executed and judged, and there is need for neither a filter nor a restoration phase. */
#include "gbt_interior.h"

#include "gbt_form.h"
#include "gbt_math.h"
#include "gbt_slacks.h"

#define FRACTION ((gbt_real)0.99)       /* of the way to zero that a multiplier may go in one step */
#define ARMIJO ((gbt_real)1e-4)
#define SHORTEST ((gbt_real)1e-10)      /* step at which the line search gives up */
#define FEWEST ((gbt_real)40)           /* sides of a piece among which the gap is shared, at least */
#define CORRECTABLE ((gbt_real)10)      /* slopes by which a full step may miss the merit before it to be corrected */
#define NEAR_ENOUGH ((gbt_real)20)     /* error over mu at which mu is lowered */
#define DELTA_FIRST ((gbt_real)1e-5)    /* first regularisation of an indefinite Hessian */
#define DELTA_LAST ((gbt_real)1e12)
#define ESCALATION ((gbt_real)100)      /* of the weight of thrust limits that a solution violates */
#define HEAVIEST ((gbt_real)1e7)

int gbt_all_finite(const gbt_real *x, int count)
{
    for (int k = 0; k < count; k++)
        if (!isfinite(x[k])) return 0;
    return 1;
}

void gbt_weigh_limits(gbt_workspace *work, gbt_real thrust, gbt_real others)
{
    gbt_real *c = work->c, *inverse = work->inverse, *width = work->width;
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        const gbt_real hard = limit->kind == GBT_THRUST ? thrust : others;
        for (int k = limit->first; k <= limit->intervals; k++) {
            /* the trapezoidal rule of the penalty */
            const gbt_real node = k == 0 || k == limit->intervals ? (gbt_real)0.5 : 1;
            for (int r = 0; r < limit->sides; r++) {
                *c = (limit->hard ? hard : node) * limit->weight[r];
                *inverse++ = 1 / *c++;
                *width++ = limit->width[r];
            }
        }
    }
}

static int belongs(const gbt_limit *limit, gbt_which which)
{
    if (which == GBT_ALL) return 1;
    return limit->hard && (limit->kind == GBT_THRUST) == (which == GBT_HARD_THRUST);
}

gbt_real gbt_worst_side(const gbt_workspace *work, gbt_which which)
{
    const gbt_real *y = work->y;
    gbt_real worst = -GBT_INFINITY;
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            const int count = limit->nodes * limit->sides;
            for (int k = 0; k < count && belongs(limit, which); k++)
                if (y[k] > worst) worst = y[k];
            y += count;
        }
    return worst;
}

/* Numbers of all pieces, and the first of them. */
static int numbers_of(const gbt_workspace *work) { return (work->pieces + GBT_ROWS_OF_PIECES - GBT_PIECES) * GBT_PIECE; }

static gbt_real *first_of(gbt_piece *pieces) { return (gbt_real *)pieces; }

void gbt_lagrangian_gradient(gbt_workspace *work, const gbt_real *multipliers)
{
    const int count = numbers_of(work);
    gbt_real *pull = first_of(work->pull), *gradient = first_of(work->gradient);
    for (int k = 0; k < count; k++) pull[k] = gradient[k];
    gbt_pull_back(work, multipliers, work->pull);
}

/* Infinity norm of the gradient of the Lagrangian, per scaled unknown; NaN if there is one in it. */
static gbt_real residual(gbt_workspace *work)
{
    gbt_real worst = 0;
    gbt_lagrangian_gradient(work, work->lambda);
    gbt_adjoint(work, work->pull, work->push);
    for (int i = 0; i < work->pieces; i++)
        for (int a = 0; a < GBT_FREE; a++) {
            const gbt_real slope = gbt_fabs(work->push[i][a] * gbt_input_scale[a]);
            if (!(slope <= worst)) worst = slope;
            if (isnan(worst)) return worst;
        }
    return worst;
}

static gbt_real objective_slope(gbt_workspace *work)
{
    const int count = numbers_of(work);
    const gbt_real *gradient = first_of(work->gradient), *step = first_of(work->step);
    gbt_real slope = 0;
    for (int k = 0; k < count; k++) slope += gradient[k] * step[k];
    return slope;
}

/* Factorises the Hessian regularised as much as makes it positive definite; returns how much, negative if nothing
   helps. It starts well below what the last indefinite Hessian needed: a factorisation costs little beside the Hessian,
   and a step that is damped too much costs an iteration. */
static gbt_real convexify(gbt_workspace *work, gbt_real last)
{
    gbt_real delta = last / 100 > DELTA_FIRST ? last / 100 : DELTA_FIRST;
    if (gbt_factorise(work, 0)) return 0;
    for (; delta < DELTA_LAST; delta *= 4)
        if (gbt_factorise(work, delta)) return delta;
    return -1;
}

/* Newton's step with the multipliers work->step_of.target, of which sigma and shift are known. */
static void find_step(gbt_workspace *work)
{
    gbt_lagrangian_gradient(work, work->step_of.target);
    gbt_newton_step(work, work->pull);
    gbt_push_forward(work);
    gbt_recover(work);
}

/* Merit after a step alpha, GBT_INFINITY where there is none; leaves work->trial, f_trial and y_trial there. */
static gbt_real merit_after(gbt_workspace *work, gbt_real mu, gbt_real alpha)
{
    gbt_real merit;
    gbt_try(work, alpha);
    work->f_trial = gbt_evaluate(work, work->trial, work->y_trial);
    merit = work->f_trial + gbt_barrier(work, mu, alpha);
    return isfinite(merit) ? merit : GBT_INFINITY;
}

/* What rounding leaves unknown of a merit. */
static gbt_real noise_of(gbt_real merit) { return 10 * GBT_EPSILON * (1 + gbt_fabs(merit)); }

/* The full step, or the full corrected step where the full one does not miss by far, or a part of the step that decreases the merit, of which the slope along the
   step is given; returns the part, 0 if there is none, and the merit there. */
static gbt_real search(gbt_workspace *work, gbt_real mu, gbt_real slope, gbt_real *merit)
{
    const gbt_real before = *merit, noise = noise_of(before);
    *merit = merit_after(work, mu, 1);
    if (*merit <= before + ARMIJO * slope + noise) return 1;
    if (*merit - before < CORRECTABLE * -slope) {
        gbt_correct(work, mu);
        find_step(work);
        *merit = merit_after(work, mu, 1);
        if (*merit <= before + ARMIJO * slope + noise) return 1;
        gbt_eliminate(work, mu);
        find_step(work);
    }
    for (gbt_real alpha = (gbt_real)0.5; alpha > SHORTEST; alpha /= 2) {
        *merit = merit_after(work, mu, alpha);
        if (*merit <= before + ARMIJO * alpha * slope + noise) return alpha;
    }
    return 0;
}

static void accept(gbt_workspace *work, gbt_real mu, gbt_real alpha)
{
    const int count = numbers_of(work);
    gbt_real *piece = first_of(work->piece), *trial = first_of(work->trial);
    for (int k = 0; k < count; k++) piece[k] = trial[k];
    work->f = work->f_trial;
    gbt_move_sides(work, mu, alpha, 1 - mu > FRACTION ? 1 - mu : FRACTION);
}

int gbt_make_ready(gbt_workspace *work, gbt_real mu)
{
    work->f = gbt_evaluate(work, work->piece, work->y);
    if (!isfinite(work->f) || !gbt_all_finite(work->y, work->count)) return 0;
    gbt_lift(work, mu);
    gbt_centre(work, mu);
    gbt_differentiate(work);
    if (isnan(residual(work))) return 0;
    gbt_eliminate(work, mu);
    gbt_assemble(work);
    return convexify(work, 0) >= 0;
}

gbt_real gbt_last_barrier(const gbt_settings *settings)
{
    return settings->gap / gbt_fmax((gbt_real)GBT_COUNT / GBT_PIECES, FEWEST);
}

gbt_status gbt_minimise(gbt_real tolerance, gbt_real mu, gbt_real mu_last, gbt_real reach, int iterations,
                        gbt_workspace *work, gbt_result *result)
{
    const int begin = result->iterations, last = begin + iterations;
    gbt_real delta = 0, merit;
    int flat = 0; /* whether the step promises less than rounding hides: then the iterate is as good as the precision
                     allows, also where the gradient is larger than the tolerance, as next to a kink of the objective
                     that the precision does not resolve */

    if (mu < mu_last || work->count == 0) mu = mu_last;
    work->f = gbt_evaluate(work, work->piece, work->y);
    if (!isfinite(work->f) || !gbt_all_finite(work->y, work->count)) return GBT_NUMERICAL_FAILURE;
    gbt_lift(work, mu);
    merit = work->f + gbt_centre(work, mu);
    for (;; result->iterations++) {
        gbt_differentiate(work);
        result->residual = residual(work);
        if (isnan(result->residual)) return GBT_NUMERICAL_FAILURE;

        if (mu <= mu_last && (result->residual <= tolerance || flat) && gbt_off_centre(work, mu) <= 10 * mu)
            return GBT_SOLVED;
        if (result->iterations >= last) return GBT_ITERATION_LIMIT;
        while (mu > mu_last && (result->residual <= NEAR_ENOUGH * mu || flat) &&
               gbt_off_centre(work, mu) <= NEAR_ENOUGH * mu) {
            mu = gbt_fmin(mu / 5, gbt_pow(mu, (gbt_real)1.2));
            if (mu < mu_last) mu = mu_last;
            merit = work->f + gbt_centre(work, mu);
            flat = 0;
        }

        gbt_eliminate(work, mu);
        gbt_assemble(work);
        const gbt_real added = convexify(work, delta);
        if (added < 0) return GBT_NUMERICAL_FAILURE;
        if (added > 0) delta = added;
        find_step(work);
        const gbt_real slope = objective_slope(work) + gbt_barrier_slope(work, mu);
        flat = gbt_fabs(slope) <= noise_of(merit);
        if (result->iterations == begin && -slope > reach * mu * (gbt_real)work->count) {
            result->iterations++;
            return GBT_FAR;
        }

        const gbt_real alpha = search(work, mu, slope, &merit);
        if (alpha <= 0) return GBT_NUMERICAL_FAILURE;
        accept(work, mu, alpha);
    }
}

/* Violated limits on thrust are made dearer until they are kept or nothing more is gained: they are never given up for
   others. The others have the weight of their class, above which an objective must be steep to break them. */
gbt_status gbt_minimise_within_limits(const gbt_settings *settings, gbt_real mu, gbt_real reach, int deadline,
                                      gbt_workspace *work, gbt_result *result)
{
    gbt_real before = GBT_INFINITY;
    for (gbt_real weight = settings->limit_weight;; weight *= ESCALATION) {
        const int left = deadline - result->iterations;
        gbt_weigh_limits(work, weight, settings->limit_weight);
        const gbt_status status =
            gbt_minimise(settings->tolerance, mu, gbt_last_barrier(settings), before < GBT_INFINITY ? GBT_INFINITY : reach,
                         left < settings->iterations ? left : settings->iterations, work, result);
        const gbt_real violation = gbt_worst_side(work, GBT_HARD_THRUST);
        if (status != GBT_SOLVED) return status;
        if (violation <= settings->feasibility)
            return gbt_worst_side(work, GBT_HARD_OTHERS) <= settings->feasibility ? GBT_SOLVED : GBT_GIVEN_UP;
        if (weight >= HEAVIEST || violation > (gbt_real)0.99 * before) return GBT_LIMIT_VIOLATED;
        before = violation;
    }
}
