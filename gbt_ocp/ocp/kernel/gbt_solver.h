/* Solver of trajectory problems: the interface of the kernel. A trajectory has one of two forms (gbt_form.h).

   The problem itself (sizes, limits, derivatives) is generated: gbt_problem.h and gbt_problem.c. The kernel allocates
   nothing, recurses nowhere, keeps nothing between calls outside the workspace, and calls only libm. */
#include "gbt_identity.h"

#ifndef GBT_SOLVER_H
#define GBT_SOLVER_H

#include <stddef.h>

#include "gbt_problem.h"

GBT_BEGIN_C

#if GBT_SHOOTING
#define GBT_STATE GBT_STATES                  /* the state at the beginning of a piece */
#define GBT_MOTION GBT_STATE                  /* that a limit looks at where a plan begins */
#define GBT_FREE GBT_HELD                     /* the inputs that are held, or change linearly, over it */
#define GBT_PIECE (GBT_STATE + GBT_FREE)      /* numbers that describe a piece: state, inputs */
#define GBT_POINT (GBT_PIECE + 1)             /* the same and the share of the piece that is over */
#define GBT_ROWS_OF_PIECES (GBT_PIECES + 1)   /* one more than the pieces, for the state at the end */
typedef gbt_real gbt_piece[GBT_PIECE];
#else
#define GBT_DERIVATIVES (GBT_DEGREE + 1)      /* 0 .. L of the flat output */
#define GBT_ORDERS (GBT_DERIVATIVES + GBT_REMEMBERED) /* they describe a piece, with what is remembered: the lowest free */
#define GBT_ROW(l) ((l) < GBT_JOINED ? (l) : (l) + GBT_REMEMBERED) /* one of the piece before, after those that join */
#define GBT_PIECE (GBT_ORDERS * GBT_FLAT)     /* numbers that describe a piece */
#define GBT_MOTION (GBT_JOINED * GBT_FLAT)    /* the continuous derivatives, */
#define GBT_STATE (GBT_MOTION + GBT_REMEMBERED * GBT_FLAT) /* and all that a piece inherits from the one before */
#define GBT_FREE (GBT_PIECE - GBT_STATE)      /* those above them, up to the L-th: what is free in a piece */
#define GBT_POINT (GBT_SEEN * GBT_FLAT)       /* z, its rate, its acceleration at one time, and what is remembered or z's next derivative */
#define GBT_ROWS_OF_PIECES GBT_PIECES
typedef gbt_real gbt_piece[GBT_ORDERS][GBT_FLAT];
#endif
#define GBT_SIDES_OF_PIECE (GBT_COUNT / GBT_PIECES)
#define GBT_TERMS (1 + GBT_SUMS) /* of the objective: the one that is a sum itself, and the sums that it is a function of */
#define GBT_PLACE (GBT_POINT + GBT_KNOT_NUMBERS) /* the same, and the numbers that constraints need at that time */

/* numbers that change from solve to solve: of the objective at the endpoints, then of the limits at the boundaries */
#define GBT_LIMIT_NUMBERS (GBT_PIECES * GBT_END_NUMBERS)
#define GBT_NUMBERS (GBT_LIMIT_NUMBERS + (GBT_PIECES + 1) * GBT_KNOT_NUMBERS)

typedef enum {
    GBT_SOLVED = 0,
    GBT_LIMIT_VIOLATED = 1,    /* no plan keeps the thrust limits: the one of least violation */
    GBT_ITERATION_LIMIT = 2,   /* out of iterations; the iterate is finite and can be judged by its violation */
    GBT_NOT_FINITE = 3,        /* an input is NaN or infinite; nothing was done */
    GBT_NUMERICAL_FAILURE = 4, /* no usable iterate */
    GBT_BROKEN_BETWEEN_NODES = 5, /* of a plan: solved, but its first piece breaks a thrust limit between the nodes */
    GBT_GIVEN_UP = 6,          /* solved; thrust is kept, and other limits had to give: the plan of least violation */
    GBT_FAR = 7                /* inside the solver only: the guess is too far from a solution */
} gbt_status;

typedef struct {
    gbt_real tolerance;      /* largest gradient of the Lagrangian, per scaled unknown */
    gbt_real gap;            /* largest sum of the complementarity products of a piece: bounds what its objective loses */
    gbt_real feasibility;    /* a hard limit counts as kept up to this, in units of the limit */
    gbt_real barrier;        /* mu at a cold start */
    gbt_real warm_barrier;   /* mu at a warm start: the longer the horizon, the nearer the shifted plan is to optimal */
    gbt_real limit_weight;   /* unit of the weights of hard limits: an l1 penalty is exact while multipliers stay below
                                its weight */
    int iterations;          /* of one start, before another one is tried */
    int deadline;            /* of all starts together, and of all attempts of a step */
} gbt_settings;

typedef struct {
    gbt_status status;
    int iterations;
    int starts;              /* 1, unless the solver had to begin again */
    gbt_real residual;       /* infinity norm of the gradient of the Lagrangian, per scaled unknown */
    gbt_real violation;      /* worst violation of a limit at the nodes as the solver sees it, tightening and back-off
                                included, in units of the limits; negative inside */
    gbt_real objective;      /* to be maximised, without penalty */
} gbt_result;

/* Everything a solve needs besides its arguments; its content on entry does not matter. A "side" is one bound of one
   constraint at one node. */
typedef struct {
    /* the trajectory: the numbers of each piece */
    gbt_piece piece[GBT_ROWS_OF_PIECES];
    gbt_piece trial[GBT_ROWS_OF_PIECES];
    gbt_piece step[GBT_ROWS_OF_PIECES];
    /* derivatives with respect to them */
    gbt_piece gradient[GBT_ROWS_OF_PIECES];
    gbt_piece pull[GBT_ROWS_OF_PIECES];
    gbt_real curvature[GBT_ROWS_OF_PIECES][GBT_PIECE][GBT_PIECE];
    gbt_real place[GBT_PLACES][GBT_PLACE]; /* of the trajectory that was evaluated last */
    gbt_real jacobian[GBT_JACOBIANS];
#if GBT_SHOOTING
    gbt_real slopes[GBT_PIECES][GBT_STATE][GBT_PIECE]; /* of the state at the end of each piece */
    gbt_real bend[GBT_PIECES][GBT_ENTRIES]; /* its Hessians times the multipliers of the dynamics */
#if GBT_BOX >= 0 /* Newton's method within bounds: gbt_shoot_box.c */
    gbt_real lower[GBT_FREE], upper[GBT_FREE];
    int held[GBT_PIECES][GBT_FREE]; /* 1 at the upper one, -1 at the lower one */
    gbt_real model[GBT_ROWS_OF_PIECES][GBT_PIECE][GBT_PIECE];
    gbt_real rest[GBT_ROWS_OF_PIECES][GBT_STATE][GBT_STATE], next[GBT_ROWS_OF_PIECES][GBT_STATE]; /* of the recursion */
    gbt_real rows[GBT_PIECES][GBT_FREE][GBT_PIECE], slope[GBT_PIECES][GBT_FREE]; /* of the inputs, before they are held */
#endif
#if GBT_STEPS > 1
    gbt_real passed[GBT_PIECES][GBT_STEPS + 1][GBT_LAST]; /* states after the steps, and their derivatives */
    gbt_real along[GBT_PIECES][GBT_STEPS + 1][GBT_LAST][GBT_PIECE];
#endif
#endif
    /* the Riccati recursion */
    gbt_real factor[GBT_PIECES][GBT_FREE][GBT_FREE];
    gbt_real gain[GBT_PIECES][GBT_FREE][GBT_STATE];
    gbt_real push[GBT_PIECES][GBT_FREE];
    /* the objective: terms and sums of the pieces before the first, and what f falls by where one of them grows */
    gbt_real before[GBT_TERMS], worth[GBT_TERMS];
#if GBT_SUMS
    gbt_real bond[GBT_SUMS][GBT_SUMS]; /* second derivatives of f by the sums */
    gbt_real sum_slopes[GBT_PIECES][GBT_SUM_COLUMNS][GBT_SUMS]; /* by what the state at the end of a piece begins with */
    gbt_real sum_gain[GBT_PIECES][GBT_FREE][GBT_SUMS];
#endif
    /* limits: y = e + s - t - width, with weight c, multipliers lambda of t and c - lambda of s; c, its inverse and the
       half widths are the same in every piece, and only penalties have an e */
    gbt_real c[GBT_SIDES_OF_PIECE + 1], inverse[GBT_SIDES_OF_PIECE + 1], width[GBT_SIDES_OF_PIECE + 1];
    gbt_real y[GBT_SIDES], y_trial[GBT_SIDES], s[GBT_SIDES], t[GBT_SIDES], lambda[GBT_SIDES];
    gbt_real sigma[GBT_SIDES], shift[GBT_SIDES];
    union {
        gbt_real target[GBT_SIDES]; /* the multipliers that Newton's step is found with, */
        gbt_real dy[GBT_SIDES];     /* and what it changes y by */
    } step_of;
    gbt_real e[GBT_SOFT ? GBT_SIDES : 1], de[GBT_SOFT ? GBT_SIDES : 1];
    /* what the present solve is about */
    gbt_real guess[GBT_PIECES * GBT_FREE];
    int first, pieces, count; /* of the part of the horizon that is being solved: its first piece, pieces, and sides of
                                 their limits */
    const gbt_real *parameters, *moving;
    gbt_real tightening[GBT_LIMITS + 1], f, f_trial;
} gbt_workspace;

/* What a guess is: anything; the rest of a plan, optimal nearly everywhere but at its end; or the solution of the same
   instance with another tightening. */
enum { GBT_COLD_START = 0, GBT_WARM = 1, GBT_AGAIN = 2 };

/* GBT_DEFAULT_SETTINGS: the options with which the planner was generated. */
#define gbt_default_settings GBT_NAME(gbt_default_settings)
void gbt_default_settings(gbt_settings *settings);

/* Size of the workspace in bytes, for callers that do not see the struct. */
size_t gbt_workspace_bytes(void);

/* Solves one instance, in coordinates relative to an origin (gbt_places.h).

   start        the state where the plan begins, GBT_STATE: of a flat vehicle the continuous derivatives of the flat
                output, itself first, GBT_JOINED x GBT_FLAT
   parameters   numbers of the objective, GBT_PIECES x GBT_END_NUMBERS, then of the limits at the boundaries of the
                pieces, (GBT_PIECES + 1) x GBT_KNOT_NUMBERS
   tightening   of each limit, GBT_LIMITS: moves its bounds inwards in the first piece, in units of the limit
   warm         GBT_COLD_START, GBT_WARM or GBT_AGAIN
   u            GBT_PIECES x GBT_FREE: in, the guess; out, the solution; what is free in a piece over gbt_input_scale */
gbt_status gbt_solve(const gbt_settings *settings, const gbt_real *start, const gbt_real *parameters,
                     const gbt_real *tightening, int warm, gbt_real *u, gbt_workspace *work, gbt_result *result);

GBT_END_C

#endif
