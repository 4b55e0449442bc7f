/* One solve: from where it starts, and what is done where it fails. The method is in gbt_interior.c. */
#include "gbt_solver.h"

#include "gbt_check.h"
#include "gbt_form.h"
#include "gbt_interior.h"
#include "gbt_math.h"
#include "gbt_slacks.h"

#define SHORT 5 /* pieces of a horizon that is solved as a whole at once */
#define HELD 10 /* pieces of a horizon over which thrust that is held all along may be a good guess */
/* Pieces of a part of a longer one that is solved by itself, and how well: it only has to be a good guess. */
#define PART (GBT_PIECES < 16 ? GBT_PIECES / 2 : 8)
#define ROUGH ((gbt_real)1e-2)
#define ROUGHER ((gbt_real)0.1)
#define TAIL_ITERATIONS 8
#define COLDER ((gbt_real)10) /* mu of the first part of a cold guess over that of a cold start */
#define REACH ((gbt_real)20)  /* decrease that Newton's step may promise from a warm guess, for each side in units of mu */
#define AT_LIMIT ((gbt_real)0.05) /* of a thrust limit, within which a guess counts as at it */
#define SHARE ((gbt_real)0.97)    /* of the thrust there is: between the nodes it may bulge */
#if GBT_INPUTS < 4
#define MIXED GBT_INPUTS /* inputs whose every combination is tried */
#else
#define MIXED 4
#endif
#define BROKEN ((gbt_real)0.1) /* of a hard limit where a plan begins, in its units: more than a follower is off */

/* Whether inputs alone may bound a trajectory. */
#if GBT_SHOOTING && GBT_BOX >= 0
#define GBT_WITHIN_BOX 1
#else
#define GBT_WITHIN_BOX 0
#endif

/* of the full thrust, at each start that is not from a given guess */
static const gbt_real aside_at_start[] = {GBT_ASIDE, (gbt_real)0.1, (gbt_real)-0.1, (gbt_real)0.3};

/* mu of each start over that of the first */
static const gbt_real barrier_of_start[] = {1, 3, 10, (gbt_real)0.3};
enum { STARTS = sizeof barrier_of_start / sizeof barrier_of_start[0] };

void gbt_default_settings(gbt_settings *settings)
{
    static const gbt_settings defaults = GBT_DEFAULT_SETTINGS;
    *settings = defaults;
}

size_t gbt_workspace_bytes(void) { return sizeof(gbt_workspace); }

/* Makes pieces first .. first + pieces - 1 of the trajectory u from start what is solved next. */
static void load(const gbt_real *start, const gbt_real *parameters, int first, int pieces, const gbt_real *u,
                 gbt_workspace *work)
{
    work->first = first;
    work->pieces = pieces;
    work->count = GBT_COUNT / GBT_PIECES * pieces;
    work->parameters = parameters + first * GBT_END_NUMBERS;
    work->moving = parameters + GBT_LIMIT_NUMBERS + first * GBT_KNOT_NUMBERS;
    for (int k = 0; k < GBT_TERMS; k++) work->before[k] = 0;
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(work->piece[0], a) = start[a];
    for (int i = 0; i < first + pieces; i++) {
        gbt_piece *piece = &work->piece[i < first ? 0 : i - first];
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(*piece, a) = u[i * GBT_FREE + a] * gbt_input_scale[a];
        if (i < first && GBT_SUMS) gbt_add_terms(*piece, parameters + i * GBT_END_NUMBERS, work->before);
        if (i < first) gbt_next_piece(*piece, *piece);
    }
    gbt_propagate(work->piece, pieces);
}

static void store(gbt_workspace *work, int first, gbt_real *u)
{
    for (int i = 0; i < work->pieces; i++)
        for (int a = 0; a < GBT_FREE; a++)
            u[(first + i) * GBT_FREE + a] = *gbt_free(work->piece[i], a) / gbt_input_scale[a];
}

/* Solves some pieces of the trajectory u, those before them fixed and those after them left out, while mu falls from one
   value to another. Returns how many iterations that took. */
static int solve_part(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters, int first,
                      int pieces, gbt_real tolerance, gbt_real mu, gbt_real mu_last, int most, gbt_real *u,
                      gbt_workspace *work)
{
    gbt_result found;
    found.iterations = 0;
    load(start, parameters, first, pieces, u, work);
    gbt_weigh_limits(work, settings->limit_weight, settings->limit_weight);
    const gbt_status status = gbt_minimise(tolerance, mu, mu_last, GBT_INFINITY, most, work, &found);
    if (status == GBT_SOLVED || status == GBT_ITERATION_LIMIT) store(work, first, u);
    return found.iterations;
}

/* As many iterations of the whole as cost the same as so many of a single piece. */
static int of_whole(int iterations) { return (iterations + GBT_PIECES - 1) / GBT_PIECES; }

/* A shifted plan is optimal nearly everywhere but at its end, where the new piece coasts and the pieces before it were
   planned as if nothing came after them. Left to the whole problem, the few pieces there take most of its iterations,
   each as dear as all pieces together, and end in a poor local optimum. So they are solved first, their beginning
   fixed, from a barrier that lets them move. Where that takes long, something before them has to change. */
static void solve_tail(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters, gbt_real *u,
                       gbt_workspace *work, gbt_result *result)
{
    const int most = settings->deadline < TAIL_ITERATIONS ? settings->deadline : TAIL_ITERATIONS;
    const int spent = solve_part(settings, start, parameters, GBT_PIECES - PART, PART, ROUGH, settings->barrier,
                                 settings->warm_barrier, most, u, work);
    result->iterations += of_whole(spent * PART);
}

/* A guess that is far from a solution, coasting or the rest of a plan for a target that was believed to be elsewhere, is
   led there part by part from its beginning, each part overlapping the one before by half: few pieces bend less than
   many, so that their steps are longer, and cost less. What the vehicle does first decides most, and may move most. */
static void solve_in_parts(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters, int warm,
                           gbt_real *u, gbt_workspace *work, gbt_result *result)
{
    const gbt_real mu_last = warm ? gbt_fmax(settings->warm_barrier, gbt_last_barrier(settings)) : settings->barrier;
    const int budget = (settings->deadline - result->iterations) * GBT_PIECES;
    gbt_real mu = warm ? settings->barrier : COLDER * settings->barrier;
    int spent = 0;
    for (int first = 0, end = 0; end < GBT_PIECES; first += (PART + 1) / 2) {
        const int pieces = GBT_PIECES - first < PART ? GBT_PIECES - first : PART;
        const int left = (budget - spent) / pieces, most = settings->iterations < left ? settings->iterations : left;
        spent += pieces * solve_part(settings, start, parameters, first, pieces, ROUGHER, mu, mu_last, most, u, work);
        mu = mu_last;
        end = first + pieces;
    }
    result->iterations += of_whole(spent);
}

/* Within the bounds of the inputs alone, where that does; by the interior-point method from the same guess where other
   limits count, or where nothing else led anywhere. */
static gbt_status answer(const gbt_settings *settings, gbt_real mu, gbt_real reach, const gbt_real *start,
                         const gbt_real *parameters, gbt_workspace *work, gbt_result *result)
{
    load(start, parameters, 0, GBT_PIECES, work->guess, work);
#if GBT_WITHIN_BOX
    const int left = settings->deadline - result->iterations, last = result->starts + 1 == STARTS;
    const int most = settings->iterations < left && !last ? settings->iterations : left;
    const gbt_status status = gbt_minimise_in_box(settings, most, work, result);
    if (status == GBT_SOLVED) return status;
    if (status == GBT_ITERATION_LIMIT && (!last || result->iterations >= settings->deadline)) {
        work->f = gbt_evaluate(work, work->piece, work->y);
        return status;
    }
    load(start, parameters, 0, GBT_PIECES, work->guess, work);
#endif
    return gbt_minimise_within_limits(settings, mu, reach, settings->deadline, work, result);
}

/* Whether a hard limit is broken far where the plan begins, and a guess leads further in. A last plan that led there was
   for a target that is believed to be elsewhere now: a cold guess is nearer to a way out. One that was made inside the
   limit already leads out, and is the best guess there is. */
static int leads_further_in(const gbt_real *start, const gbt_real *parameters, const gbt_real *guess)
{
    const gbt_real *moving = parameters + GBT_LIMIT_NUMBERS;
    gbt_real broken[GBT_LIMITS + 1], top[GBT_PIECES * GBT_FREE], worst[GBT_PIECES][GBT_LIMITS + 1];
    int far = 0;
    gbt_broken_at_start(start, moving, broken);
    for (int q = 0; q < GBT_LIMITS; q++)
        if (gbt_limits[q].hard && broken[q] > BROKEN) far = 1;
    if (!far) return 0;
    for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) top[k] = guess[k] * gbt_input_scale[k % GBT_FREE];
    gbt_survey(start, top, GBT_PIECES, GBT_NODES, moving, worst);
    for (int q = 0; q < GBT_LIMITS; q++)
        for (int i = 0; i < GBT_PIECES; i++)
            if (gbt_limits[q].hard && broken[q] > BROKEN && worst[i][q] > broken[q]) return 1;
    return 0;
}

/* Whether a guess, which was evaluated last, has at least half of its inputs at their limits, or beyond. */
static int is_pressed(const gbt_workspace *work)
{
    const gbt_real *y = work->y;
    int pressed = 0, sides = 0;
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const int count = gbt_limits[q].nodes * gbt_limits[q].sides;
            if (gbt_limits[q].hard && gbt_limits[q].kind == GBT_THRUST) {
                for (int k = 0; k < count; k++)
                    if (y[k] > -AT_LIMIT) pressed++;
                sides += count;
            }
            y += count;
        }
    return 4 * pressed >= sides && sides > 0; /* an input has two sides */
}

/* What is to be minimised at the guess, at which limits count by their exact penalties. */
static gbt_real cost_of_guess(const gbt_real *start, const gbt_real *parameters, const gbt_real *guess,
                              gbt_workspace *work)
{
    load(start, parameters, 0, GBT_PIECES, guess, work);
    work->f = gbt_evaluate(work, work->piece, work->y);
    return work->f + gbt_penalty(work);
}

/* Where the limits of the inputs decide what a plan is, it may be one of several, each the best of those near it, and the
   rest of a plan leads to the one it is a rest of, step after step, until that is far worse than another one. So such a
   guess is compared with inputs that are held at their limits all along, in every combination, and the cheapest is
   solved from. */
static void choose_guess(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters,
                         gbt_workspace *work)
{
    gbt_real share[GBT_INPUTS], other[GBT_PIECES * GBT_FREE];
    int combinations = 1;
    gbt_weigh_limits(work, settings->limit_weight, settings->limit_weight);
    gbt_real least = cost_of_guess(start, parameters, work->guess, work);
    if (!is_pressed(work)) return;
    for (int j = 0; j < GBT_INPUTS; j++) share[j] = 0;
    for (int j = 0; j < MIXED; j++) combinations *= 3;
    for (int n = 0; n < combinations; n++) {
        for (int j = 0, rest = n; j < MIXED; j++, rest /= 3) share[j] = SHARE * (gbt_real)(rest % 3 - 1);
        gbt_press(start, share, other);
        for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) other[k] /= gbt_input_scale[k % GBT_FREE];
        const gbt_real cost = cost_of_guess(start, parameters, other, work);
        if (!(cost < least)) continue;
        least = cost;
        for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) work->guess[k] = other[k];
    }
}

/* Where the next start begins; the last one within bounds goes on from the cheapest before it, u. */
static void begin_again(const gbt_real *start, int starts, const gbt_real *u, gbt_real *guess)
{
    const int from_cheapest = GBT_WITHIN_BOX && starts + 1 == STARTS;
    gbt_coast(start, aside_at_start[starts % STARTS], guess);
    for (int k = 0; k < GBT_PIECES * GBT_FREE; k++)
        guess[k] = from_cheapest ? u[k] : guess[k] / gbt_input_scale[k % GBT_FREE];
}

gbt_status gbt_solve(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters,
                     const gbt_real *tightening, int warm, gbt_real *u, gbt_workspace *work, gbt_result *result)
{
    const int is_long = GBT_PIECES > SHORT, in_parts = is_long && !GBT_WITHIN_BOX;
    gbt_real cheapest = GBT_INFINITY;
    gbt_status status;

    result->status = GBT_NOT_FINITE;
    result->iterations = result->starts = 0;
    result->residual = result->violation = GBT_INFINITY;
    result->objective = -GBT_INFINITY;
    if (!gbt_all_finite(start, GBT_STATE) || !gbt_all_finite(parameters, GBT_NUMBERS) ||
        !gbt_all_finite(u, GBT_PIECES * GBT_FREE) || !gbt_all_finite(tightening, GBT_LIMITS))
        return result->status;

    for (int q = 0; q < GBT_LIMITS; q++) work->tightening[q] = tightening[q];
    for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) work->guess[k] = u[k];
    if (in_parts && warm == GBT_WARM && leads_further_in(start, parameters, u)) {
        warm = GBT_COLD_START;
        begin_again(start, 0, u, work->guess);
    }
    if (GBT_PIECES <= HELD && !in_parts && warm == GBT_WARM) choose_guess(settings, start, parameters, work);
    result->status = GBT_NUMERICAL_FAILURE;
    do {
        const int cold = warm == GBT_COLD_START || result->starts > 0, shifted = !cold && warm == GBT_WARM;
        const gbt_real mu = cold ? settings->barrier * barrier_of_start[result->starts] : settings->warm_barrier;
        gbt_result found = *result;
        if (is_long && shifted) solve_tail(settings, start, parameters, work->guess, work, &found);
        if (in_parts && cold) solve_in_parts(settings, start, parameters, 0, work->guess, work, &found);
        status = answer(settings, mu, in_parts && shifted ? REACH : GBT_INFINITY, start, parameters, work, &found);
        if (status == GBT_FAR) {
            for (int k = 0; k < GBT_PIECES * GBT_FREE; k++) work->guess[k] = u[k];
            solve_in_parts(settings, start, parameters, 1, work->guess, work, &found);
            status = answer(settings, mu, GBT_INFINITY, start, parameters, work, &found);
        }
        result->iterations = found.iterations;
        result->starts++;

        /* Of several unfinished starts the cheapest is kept; its limits are weighed as at first. */
        gbt_weigh_limits(work, settings->limit_weight, settings->limit_weight);
        const gbt_real cost = work->f + gbt_penalty(work);
        const int found_one = status <= GBT_LIMIT_VIOLATED || status == GBT_GIVEN_UP;
        if (found_one || cost < cheapest) {
            cheapest = cost;
            result->status = found_one ? status : GBT_ITERATION_LIMIT;
            result->residual = found.residual;
            result->violation = gbt_worst_side(work, GBT_ALL);
            result->objective = -work->f;
            store(work, 0, u);
        }
        begin_again(start, result->starts, u, work->guess);
    } while (status > GBT_LIMIT_VIOLATED && status != GBT_GIVEN_UP && result->starts < STARTS && result->iterations < settings->deadline);
    return result->status;
}
