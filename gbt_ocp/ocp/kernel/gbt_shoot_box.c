/* Newton's method on the bounds of the inputs.

   Where nothing but its inputs bounds a trajectory, neither slacks nor a barrier are needed. Each iteration minimises the
   quadratic model within the bounds: inputs are held at them as the step and the multipliers of the model say, from the
   last piece to the first by the Riccati recursion, until that changes nothing (the primal-dual active set method of
   Hintermueller, Ito and Kunisch 2002). Where the model has no minimum, the curvature that the objective has in the
   position is turned to be positive at the same size, and the inputs are regularised. Where that takes more than a little,
   the second derivatives of the dynamics are left out: they grow with the horizon where a vehicle is unstable, and under a
   regularisation that outweighs them nothing moves. */
#include "gbt_coupling.h"
#include "gbt_form.h"
#include "gbt_math.h"
#include "gbt_moments.h"

#if GBT_BOX >= 0

#define ARMIJO ((gbt_real)1e-4)
#define HALVINGS 3                     /* of a step before it is regularised more */
#define LONGEST 4                      /* part of a regularised step that is tried, */
#define FLATTER ((gbt_real)0.75)       /* where it gains so much of what its slope promises: a good model says a half */
#define ROUNDS 12                    /* of the active set in an iteration; a step that is not there yet is cut */
#define DELTA_FIRST ((gbt_real)1e-3)   /* of the regularisation of an input over its size */
#define DELTA_LEAST ((gbt_real)1e-6)   /* less is none */
#define DELTA_BENT ((gbt_real)1)       /* more, and the dynamics lose their second derivatives */
#define DELTA_MOST ((gbt_real)1e8)
#define GAIN ((gbt_real)1e-6)          /* of an iteration over the objective, less than which tells of a flat valley: */
#define NEAR 10                        /* there so many tolerances do, since whole inputs lie between equal objectives */
#define RAISE 8  /* where no part of a step does */
#define MORE 4   /* where a short one does */
#define LOWER 20 /* where the whole step does */

static void find_bounds(gbt_workspace *work)
{
    const gbt_limit *limit = &gbt_limits[GBT_BOX];
    for (int a = 0; a < GBT_FREE; a++) {
        work->lower[a] = gbt_thrust_min[a % GBT_INPUTS];
        work->upper[a] = gbt_thrust_max[a % GBT_INPUTS];
    }
    for (int k = 0; k < limit->nodes; k++)
        for (int r = 0; r < limit->sides; r++) {
            const int a = k * GBT_INPUTS + limit->row[r];
            /* within by what rounding may add when the side is evaluated */
            const gbt_real bound = limit->bound[r];
            const gbt_real most = (bound - 8 * GBT_EPSILON * gbt_fabs(bound)) * gbt_thrust_max[limit->row[r]];
            if (limit->sign[r] > 0)
                work->upper[a] = most;
            else
                work->lower[a] = -most;
        }
}

static gbt_real within(const gbt_workspace *work, int a, gbt_real input)
{
    return input > work->upper[a] ? work->upper[a] : input < work->lower[a] ? work->lower[a] : input;
}

/* Cuts the inputs of a trajectory to their bounds; from where it follows gains, or not. */
static gbt_real follow(gbt_workspace *work, gbt_piece piece[], const gbt_real *part)
{
    gbt_real total[GBT_TERMS];
    for (int i = 0; i < work->pieces; i++) {
        gbt_real *inputs = gbt_free(piece[i], 0);
        if (part) gbt_follow_gains(work, i, *part, piece[i], inputs);
        for (int a = 0; a < GBT_FREE; a++) inputs[a] = within(work, a, inputs[a]);
        gbt_next_piece(piece[i], piece[i + 1]);
    }
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece[work->pieces], a) = 0;
    gbt_total(work, piece, total);
    return -gbt_gain(total);
}

/* All first derivatives at work->piece, and which inputs their slopes hold at a bound. Returns how far a step along the
   slopes, of one per scaled unknown, goes within the bounds. */
static gbt_real differentiate(gbt_workspace *work)
{
    gbt_real worst = 0;
    gbt_differentiate_motion(work);
    for (int i = 0; i <= work->pieces; i++)
        for (int a = 0; a < GBT_PIECE; a++) work->pull[i][a] = work->gradient[i][a];
    gbt_adjoint(work, work->pull, work->push);
    for (int i = 0; i < work->pieces; i++)
        for (int a = 0; a < GBT_FREE; a++) {
            const gbt_real scale = gbt_input_scale[a], input = *gbt_free(work->piece[i], a), slope = work->push[i][a];
            const gbt_real way = gbt_fabs(within(work, a, input - scale * scale * slope) - input) / scale;
            work->held[i][a] = input >= work->upper[a] && slope < 0 ? 1 : input <= work->lower[a] && slope > 0 ? -1 : 0;
            if (!(way <= worst)) worst = way;
            if (isnan(worst)) return worst;
        }
    return worst;
}

/* Makes the objective's curvature in the position positive, at the same size, in work->model. */
static void turn_up(gbt_workspace *work)
{
    for (int i = 0; i <= work->pieces; i++) {
        gbt_real a[GBT_DIMENSION][GBT_DIMENSION], v[GBT_DIMENSION][GBT_DIMENSION];
        for (int p = 0; p < GBT_DIMENSION; p++)
            for (int q = 0; q <= p; q++) a[p][q] = a[q][p] = work->curvature[i][p][q];
        gbt_diagonalise(a, v);
        for (int k = 0; k < GBT_DIMENSION; k++)
            for (int p = 0; p < GBT_DIMENSION && a[k][k] < 0; p++)
                for (int q = 0; q < GBT_DIMENSION; q++) work->model[i][p][q] -= 2 * v[p][k] * a[k][k] * v[q][k];
    }
}

/* work->model: the second derivatives of each piece, of the dynamics only where it is bent. */
static void make_model(gbt_workspace *work, int bent)
{
    for (int i = 0; i <= work->pieces; i++) {
        gbt_real(*model)[GBT_PIECE] = work->model[i];
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c <= a; c++) model[a][c] = model[c][a] = work->curvature[i][a][c];
        for (int e = 0; e < gbt_stage_entries && bent && i < work->pieces; e++) {
            const int row = gbt_stage_row[e], column = gbt_stage_column[e];
            model[row][column] += work->bend[i][e];
            model[column][row] = model[row][column];
        }
    }
}

/* Holds inputs of piece i at their bounds in the model of all that follows from it, of which q is the slope. */
static void hold(gbt_workspace *work, int i, gbt_real h[GBT_PIECE][GBT_PIECE], gbt_real *q)
{
    for (int a = 0; a < GBT_FREE; a++) {
        const int b = GBT_STATE + a;
        if (!work->held[i][a]) continue;
        const gbt_real bound = work->held[i][a] > 0 ? work->upper[a] : work->lower[a];
        const gbt_real change = bound - *gbt_free(work->piece[i], a);
        for (int c = 0; c < GBT_PIECE; c++) {
            q[c] += h[b][c] * change;
            h[b][c] = 0;
        }
        for (int c = GBT_STATE; c < GBT_PIECE; c++) h[c][b] = 0;
        h[b][b] = 1;
        q[b] = -change;
    }
}

/* work->step: the minimum of the model with these inputs held, where pieces after the last are as they were. Returns 0
   where there is none. */
static int solve_model(gbt_workspace *work, gbt_real delta, int last)
{
    gbt_real h[GBT_PIECE][GBT_PIECE], q[GBT_PIECE];
    for (int i = last; i >= 0; i--) {
        const gbt_real *next = work->next[i + 1];
        gbt_real *push = work->push[i];
        for (int a = 0; a < GBT_PIECE; a++) {
            q[a] = work->gradient[i][a];
            for (int c = 0; c < GBT_PIECE; c++) h[a][c] = work->model[i][a][c];
        }
        for (int a = 0; a < GBT_FREE; a++)
            h[GBT_STATE + a][GBT_STATE + a] += delta / (gbt_input_scale[a] * gbt_input_scale[a]);
        gbt_add_rest(work->slopes[i], work->rest[i + 1], h);
        for (int r = 0; r < GBT_STATE; r++)
            for (int a = 0; a < GBT_PIECE; a++) q[a] += work->slopes[i][r][a] * next[r];
        for (int a = 0; a < GBT_FREE; a++) {
            work->slope[i][a] = q[GBT_STATE + a];
            for (int c = 0; c < GBT_PIECE; c++) work->rows[i][a][c] = h[GBT_STATE + a][c];
        }
        hold(work, i, h, q);
        if (!gbt_eliminate_free(h, work->factor[i], work->gain[i], work->rest[i])) return 0;
        for (int a = 0; a < GBT_FREE; a++) push[a] = -q[GBT_STATE + a];
        gbt_forward(work->factor[i], push);
        for (int k = 0; k < GBT_FREE; k++)
            for (int c = 0; c < GBT_STATE; c++) q[c] += work->gain[i][k][c] * push[k];
        for (int c = 0; c < GBT_STATE; c++) work->next[i][c] = q[c];
    }
    gbt_step_along(work);
    return 1;
}

/* Holds inputs that the step takes beyond a bound, lets go of those that the model draws away from theirs. Returns the
   last piece of which that changes something, -1 if there is none. */
static int change_held(gbt_workspace *work)
{
    int last = -1;
    for (int i = 0; i < work->pieces; i++)
        for (int a = 0; a < GBT_FREE; a++) {
            const gbt_real *step = work->step[i], there = *gbt_free(work->piece[i], a) + step[GBT_STATE + a];
            gbt_real slope = work->slope[i][a];
            const int before = work->held[i][a];
            for (int c = 0; c < GBT_PIECE && before; c++) slope += work->rows[i][a][c] * step[c];
            if (before)
                work->held[i][a] = before * slope > 0 ? 0 : before;
            else
                work->held[i][a] = there > work->upper[a] ? 1 : there < work->lower[a] ? -1 : 0;
            if (work->held[i][a] != before) last = i;
        }
    return last;
}

/* The step within the bounds; returns its slope, positive where the model has no minimum. */
static gbt_real find_step(gbt_workspace *work, gbt_real delta)
{
    const int end = work->pieces;
    gbt_real slope = 0;
    for (int a = 0; a < GBT_STATE; a++) {
        work->next[end][a] = work->gradient[end][a];
        for (int c = 0; c < GBT_STATE; c++) work->rest[end][a][c] = work->model[end][a][c];
    }
    for (int round = 0, last = end - 1; last >= 0 && round < ROUNDS; round++) {
        if (!solve_model(work, delta, last)) return GBT_INFINITY;
        last = change_held(work);
    }
    for (int i = 0; i <= end; i++)
        for (int a = 0; a < GBT_PIECE; a++) slope += work->gradient[i][a] * work->step[i][a];
    return slope;
}

/* Doubles a part of the step, whose f is known, as long as f falls; leaves the last part of which it does in work->trial. */
static gbt_real lengthen(gbt_workspace *work, gbt_real part)
{
    gbt_real before = work->f_trial;
    while (part < LONGEST) {
        part *= 2;
        work->f_trial = follow(work, work->trial, &part);
        if (work->f_trial < before) {
            before = work->f_trial;
            continue;
        }
        part /= 2;
        work->f_trial = follow(work, work->trial, &part);
        break;
    }
    return part;
}

/* A part of the step that decreases f, in work->trial; 0 if none of a few does. A regularised step may be far too short:
   in a flat valley the curvature is about zero, and what makes it positive is all there is to it. */
static gbt_real search(gbt_workspace *work, gbt_real slope, int regularised)
{
    const gbt_real noise = 10 * GBT_EPSILON * (1 + gbt_fabs(work->f));
    gbt_real part = 1;
    for (int a = 0; a < GBT_STATE; a++) work->trial[0][a] = work->piece[0][a];
    for (int k = 0; k < HALVINGS; k++, part /= 2) {
        work->f_trial = follow(work, work->trial, &part);
        if (work->f_trial <= work->f + ARMIJO * part * slope + noise)
            return k == 0 && regularised && work->f_trial < work->f + FLATTER * slope ? lengthen(work, part) : part;
    }
    return 0;
}

static void more(gbt_real *delta, int times) { *delta = *delta > 0 ? *delta * times : DELTA_FIRST; }

/* One iteration. */
static int improve(gbt_workspace *work, gbt_real *delta)
{
    int turned = 0, bent = 1;
    make_model(work, bent);
    for (;;) {
        const gbt_real slope = find_step(work, *delta);
        const gbt_real part = slope < 0 ? search(work, slope, *delta > 0) : 0;
        if (part > 0) {
            if (part >= 1)
                *delta = *delta > DELTA_LEAST ? *delta / LOWER : 0;
            else if (part < (gbt_real)0.5)
                more(delta, MORE);
            return 1;
        }
        if (slope >= GBT_INFINITY && !turned) {
            turn_up(work);
            turned = 1;
        } else if (turned && bent && *delta >= DELTA_BENT) {
            bent = 0;
            make_model(work, bent);
            turn_up(work);
            *delta = 0;
        } else {
            more(delta, RAISE);
            if (!(*delta < DELTA_MOST)) return 0;
        }
    }
}

/* Whether all limits but the bounds are kept, and no penalty is above zero. */
static int others_are_kept(const gbt_settings *settings, gbt_workspace *work)
{
    const gbt_real *y = work->y;
    gbt_evaluate(work, work->piece, work->y);
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++)
                for (int r = 0; r < limit->sides; r++, y++)
                    if (q != GBT_BOX && !(*y <= (limit->hard ? settings->feasibility : -limit->width[r]))) return 0;
        }
    return 1;
}

gbt_status gbt_minimise_in_box(const gbt_settings *settings, int iterations, gbt_workspace *work, gbt_result *result)
{
    const int last = result->iterations + iterations;
    gbt_real delta = 0, gained = GBT_INFINITY;
    if (work->tightening[GBT_BOX] > 0) return GBT_ITERATION_LIMIT; /* the bounds are those of all pieces */
    find_bounds(work);
    work->f = follow(work, work->piece, 0);
    if (!isfinite(work->f)) return GBT_ITERATION_LIMIT;
    if (!others_are_kept(settings, work)) return GBT_LIMIT_VIOLATED;
    for (;; result->iterations++) {
        result->residual = differentiate(work);
        if (isnan(result->residual)) return GBT_ITERATION_LIMIT;
        if (result->residual <= settings->tolerance * (gained < GAIN * (1 + gbt_fabs(work->f)) ? NEAR : 1))
            return others_are_kept(settings, work) ? GBT_SOLVED : GBT_LIMIT_VIOLATED;
        if (result->iterations >= last) return GBT_ITERATION_LIMIT;
        gbt_bend_motion(work);
        if (!improve(work, &delta)) return GBT_ITERATION_LIMIT;
        for (int i = 0; i <= work->pieces; i++)
            for (int a = 0; a < GBT_PIECE; a++) work->piece[i][a] = work->trial[i][a];
        gained = work->f - work->f_trial;
        work->f = work->f_trial;
    }
}

#endif
