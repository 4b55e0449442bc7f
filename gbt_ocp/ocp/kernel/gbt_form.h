/* The form of a trajectory: what the method of gbt_interior.c and the planner around it need of it.

   A trajectory consists of pieces of one length. Each is described by GBT_PIECE numbers: GBT_STATE that it inherits from
   the piece before it, and GBT_FREE that are free. There are two forms. In the flat one (gbt_pieces.c) the numbers are
   derivatives of the flat output, so a piece depends linearly on the one before. In the other (gbt_shoot.c) they are the
   state of the vehicle and the inputs over the piece, and the next state follows by integration. */
#ifndef GBT_FORM_H
#define GBT_FORM_H

#include "gbt_math.h"
#include "gbt_solver.h"

GBT_BEGIN_C

/* Number a of what a piece inherits, and of what is free in it. */
#if GBT_SHOOTING
static inline gbt_real *gbt_inherited(gbt_piece piece, int a) { return &piece[a]; }
static inline gbt_real *gbt_free(gbt_piece piece, int a) { return &piece[GBT_STATE + a]; }
#else
static inline gbt_real *gbt_inherited(gbt_piece piece, int a) { return &piece[a / GBT_FLAT][a % GBT_FLAT]; }
static inline gbt_real *gbt_free(gbt_piece piece, int a)
{
    return &piece[GBT_ROW(GBT_JOINED) + a / GBT_FLAT][a % GBT_FLAT];
}
#endif

/* Eliminates what is free in a piece from the quadratic model h of all that follows from its numbers: the rows of L' of
   the Cholesky factorisation L L' of its part in what is free, with the reciprocals of the pivots; L^-1 times the rest of
   its rows, the gain; and the model of what is left as a function of the state. Of h, which is symmetric, the rows of what is
   free are read, and of the others what is of the state. Returns 0 where it is not positive definite. */
static inline int gbt_eliminate_free(gbt_real h[GBT_PIECE][GBT_PIECE], gbt_real factor[GBT_FREE][GBT_FREE],
                                     gbt_real gain[GBT_FREE][GBT_STATE], gbt_real rest[GBT_STATE][GBT_STATE])
{
    for (int a = 0; a < GBT_FREE; a++) {
        gbt_real own[GBT_FREE], across[GBT_STATE];
        for (int c = 0; c < GBT_FREE; c++) own[c] = h[GBT_STATE + a][GBT_STATE + c];
        for (int c = 0; c < GBT_STATE; c++) across[c] = h[GBT_STATE + a][c];
        for (int k = 0; k < a; k++) {
            const gbt_real part = factor[k][a];
            for (int c = 0; c < GBT_FREE; c++) own[c] -= part * factor[k][c];
            for (int c = 0; c < GBT_STATE; c++) across[c] -= part * gain[k][c];
        }
        /* also false where it is NaN */
        if (!(own[a] > 10 * GBT_EPSILON * gbt_fabs(h[GBT_STATE + a][GBT_STATE + a]))) return 0;
        const gbt_real inverse = 1 / gbt_sqrt(own[a]);
        for (int c = 0; c < GBT_FREE; c++) factor[a][c] = own[c] * inverse;
        for (int c = 0; c < GBT_STATE; c++) gain[a][c] = across[c] * inverse;
        factor[a][a] = inverse;
    }
    for (int a = 0; a < GBT_STATE; a++) {
        for (int c = 0; c < GBT_STATE; c++) rest[a][c] = h[a][c];
        for (int k = 0; k < GBT_FREE; k++)
            for (int c = 0; c < GBT_STATE; c++) rest[a][c] -= gain[k][a] * gain[k][c];
    }
    return 1;
}

/* Solves L x = b and then L' x = b in place. */
static inline void gbt_forward(gbt_real factor[GBT_FREE][GBT_FREE], gbt_real *x)
{
    for (int a = 0; a < GBT_FREE; a++) {
        x[a] *= factor[a][a];
        for (int c = a + 1; c < GBT_FREE; c++) x[c] -= factor[a][c] * x[a];
    }
}

static inline void gbt_backward(gbt_real factor[GBT_FREE][GBT_FREE], gbt_real *x)
{
    for (int a = GBT_FREE - 1; a >= 0; a--) {
        for (int c = a + 1; c < GBT_FREE; c++) x[a] -= factor[a][c] * x[c];
        x[a] *= factor[a][a];
    }
}

/* What a limit looks at after a share of a piece, but for the limit's numbers there. */
void gbt_place_after(gbt_piece piece, gbt_real share, gbt_real *place);

/* The numbers that constraints need at a share of a piece, from those at its two ends: the last of a place. */
void gbt_moving_at(const gbt_real *ends, gbt_real share, gbt_real *place);

/* What the piece after it inherits; next may be the piece itself. */
void gbt_next_piece(gbt_piece piece, gbt_piece next);

/* Fills what all pieces but the first inherit from what is free. */
void gbt_propagate(gbt_piece piece[], int pieces);

#define GBT_ASIDE ((gbt_real)1e-5) /* of the full thrust, at a cold start */

/* Where a cold solve begins: a plan that does as good as nothing, and a little thrust to one side. From a start that is
   symmetric, as dead ahead of an obstacle, steps are so too, and may creep along a ridge between two plans. The ratios of
   the thrusts are irrational, so that no axis of symmetry of rational numbers is along them.

   aside    of the full thrust
   top      out: GBT_PIECES x GBT_FREE, what is free in all pieces */
void gbt_coast(const gbt_real *start, gbt_real aside, gbt_real *top);

/* A plan under inputs that are held: a share of each of the most there is, negative of the least; GBT_INPUTS. */
void gbt_press(const gbt_real *start, const gbt_real *share, gbt_real *top);

/* What is free in a piece that is added to a plan, from what was in its last one, GBT_FREE each. */
void gbt_lengthen(const gbt_real *last, gbt_real *added);

/* Changes so many pieces of a plan, GBT_FREE each, so that they lead back to it from a start that is off by so much,
   GBT_STATE. */
void gbt_lead_back(const gbt_real *off, int pieces, gbt_real *top);

/* Changes the first piece of a plan so that its thrust keeps within the limits between the nodes too, and leads the rest
   back to itself. Returns 0 where it exceeds them by too much, or the form knows no way: the plan is then as it was. */
int gbt_mend(const gbt_real *start, gbt_real *top);

/* The last resort: a plan from start that slows the vehicle down, or does what the vehicle has for that; GBT_PIECES x
   GBT_FREE. */
void gbt_brake(const gbt_real *start, gbt_real *top);

/* Adds what the end of a piece gives to the objective's own terms, and to its sums: GBT_TERMS. */
void gbt_add_terms(gbt_piece piece, const gbt_real *numbers, gbt_real *total);

/* Of a plan: the inputs after a share of a piece; flat output and rate at its end. */
void gbt_inputs_after(gbt_piece piece, gbt_real share, gbt_real *inputs);
void gbt_end_of(gbt_piece piece, gbt_real *z, gbt_real *dz);

/* Gradient with respect to what is free in all pieces, from the one with respect to the numbers of each piece (which is
   spent): the adjoint of gbt_propagate at work->piece. */
void gbt_adjoint(const gbt_workspace *work, gbt_piece gradient[], gbt_real out[][GBT_FREE]);

/* Terms and sums of all pieces, and of those before them. */
void gbt_total(const gbt_workspace *work, gbt_piece piece[], gbt_real *total);

/* Objective and sides of the limits, and work->place, what each limit looks at at each of its nodes; returns f, minus the
   objective. */
gbt_real gbt_evaluate(gbt_workspace *work, gbt_piece piece[], gbt_real *y);

/* The trajectory work->trial after a part alpha of work->step. */
void gbt_try(gbt_workspace *work, gbt_real alpha);

/* At work->piece, which was evaluated last: gradient of f, and the Jacobians of the limits at all nodes. */
void gbt_differentiate(gbt_workspace *work);

/* out += the Jacobians transposed times one number for each side. */
void gbt_pull_back(const gbt_workspace *work, const gbt_real *sides, gbt_piece out[]);

/* work->step_of.dy, in the place of the target: the change of every side along work->step. */
void gbt_push_forward(gbt_workspace *work);

/* There, too, work->curvature: Hessian of f + lambda y, plus the Jacobians' squares weighted with work->sigma. work->pull is what
   gbt_adjoint left of the gradient with these multipliers. */
void gbt_assemble(gbt_workspace *work);

/* Factorises work->curvature, regularised by delta. The pivots of the recursion are those of a block Cholesky
   factorisation of the Hessian with respect to all unknowns, last piece first: returns 1 if that is positive definite, 0
   if not. */
int gbt_factorise(gbt_workspace *work, gbt_real delta);

/* work->step from the gradient with respect to the numbers of each piece, which is spent. */
void gbt_newton_step(gbt_workspace *work, gbt_piece gradient[]);

#if GBT_SUMS
/* What the recursion of gbt_coupling.c needs of a form: the quadratic model h from a piece on, from that of
   what comes after it, which it regularises by delta, too; that model at the end of the last piece; and the slopes of what
   the next piece inherits, GBT_STATE x GBT_PIECE. */
void gbt_piece_model(gbt_workspace *work, int i, gbt_real delta, gbt_real rest[GBT_STATE][GBT_STATE],
                     gbt_real h[GBT_PIECE][GBT_PIECE]);
void gbt_end_model(const gbt_workspace *work, gbt_real rest[GBT_STATE][GBT_STATE]);
void gbt_end_slopes(const gbt_workspace *work, int i, gbt_real slopes[GBT_STATE][GBT_PIECE]);

/* What the slopes of the sums are computed at: the point where piece i ends. */
void gbt_end_point(gbt_workspace *work, int i, gbt_real *point);
#endif

#if GBT_SHOOTING
/* Of the values of a limit in a node: what the multipliers lambda of its sides are worth together, and then sigma. */
static inline void gbt_side_weights(const gbt_limit *limit, const gbt_real *lambda, const gbt_real *sigma,
                                    gbt_real *weights)
{
    for (int r = 0; r < 2 * limit->rows; r++) weights[r] = 0;
    for (int r = 0; r < limit->sides; r++) {
        weights[limit->row[r]] += limit->sign[r] * lambda[r];
        weights[limit->rows + limit->row[r]] += sigma[r];
    }
}

/* gbt_newton_step for a start that is elsewhere by so much, GBT_STATE. */
void gbt_step_from(gbt_workspace *work, gbt_piece gradient[], const gbt_real *change);

/* gbt_differentiate without the limits, and of gbt_assemble what is not about them. */
void gbt_differentiate_motion(gbt_workspace *work);
void gbt_bend_motion(gbt_workspace *work);

/* h += F' P F, of the slopes F of the state at the end and a symmetric P; what gbt_eliminate_free reads of it. */
void gbt_add_rest(gbt_real slopes[GBT_STATE][GBT_PIECE], gbt_real rest[GBT_STATE][GBT_STATE],
                  gbt_real h[GBT_PIECE][GBT_PIECE]);

/* work->step from what the recursion left and the change of the start that is there. */
void gbt_step_along(gbt_workspace *work);

#if GBT_BOX >= 0
/* Newton's method within the bounds of the limit GBT_BOX, for trajectories that no other limit bounds: iterates from
   work->piece until a step of one per scaled unknown along the slopes, cut at the bounds, is within the tolerance, at most
   so many times. Returns GBT_SOLVED and sets result->residual if all limits are kept there, GBT_LIMIT_VIOLATED where
   another limit is broken, so that the interior-point method has to answer, and GBT_ITERATION_LIMIT where it did not get
   there. Adds to result->iterations what it took. */
gbt_status gbt_minimise_in_box(const gbt_settings *settings, int iterations, gbt_workspace *work, gbt_result *result);
#endif

/* The inputs of piece i after a part of the step, where its state has become another one. */
void gbt_follow_gains(gbt_workspace *work, int i, gbt_real part, const gbt_real *state, gbt_real *inputs);

#if GBT_STEPS > 1
/* Along a piece of several Runge-Kutta steps: its numbers after a share of it, what moves of its state after each step,
   and the derivatives of that for the numbers of the piece. */
void gbt_state_after(gbt_piece piece, gbt_real share, gbt_real *at);
void gbt_passed_states(gbt_piece piece, gbt_real states[GBT_STEPS + 1][GBT_LAST]);
void gbt_passed_slopes(gbt_piece piece, gbt_real states[GBT_STEPS + 1][GBT_LAST],
                       gbt_real along[GBT_STEPS + 1][GBT_LAST][GBT_PIECE]);
void gbt_end_slopes(gbt_real along[GBT_LAST][GBT_PIECE], gbt_real slopes[GBT_STATE][GBT_PIECE]);
/* The chain rule for a row of first derivatives. */
void gbt_chained(gbt_real along[GBT_LAST][GBT_PIECE], gbt_real *row);

/* The step at whose end a limit has its node k. */
static inline int gbt_step_of(const gbt_limit *limit, int k)
{
    return (limit->first + k) * GBT_STEPS / limit->intervals;
}

/* Of piece i, from its places and the lambda and sigma of their sides on: the second derivatives of the limits that look
   at states between the steps are added to work->curvature, and those of the state at its end are work->bend. Without places
   the limits are left out. */
void gbt_add_along_steps(gbt_workspace *work, int i, gbt_real (*place)[GBT_PLACE], const gbt_real *lambda,
                         const gbt_real *sigma);
#endif

/* Cuts the inputs of a piece to what there is, and to what their rates allow. */
void gbt_admit(gbt_piece piece);

/* work->gradient again, for other numbers of the objective. */
void gbt_objective_slopes(gbt_workspace *work);
#endif

GBT_END_C

#endif
