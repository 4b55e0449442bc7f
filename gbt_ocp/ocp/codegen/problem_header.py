"""The header of the generated problem: a text with places for its sizes."""

HEADER = """/* Generated: sizes, limits and derivatives of one trajectory problem. */
#ifndef GBT_PROBLEM_H
#define GBT_PROBLEM_H

#include "gbt_real.h"

GBT_BEGIN_C

#define GBT_FLAT {flat}              /* n, flat outputs */
#define GBT_DIMENSION {dimension}         /* d, dimension of the space */
{form}#define GBT_PIECES {pieces}            /* p, pieces of the trajectory */
#define GBT_PERIOD ((gbt_real){period}) /* T, length of a piece in seconds */
#define GBT_SUMS {sums}            /* sums over the endpoints that the objective is a function of */
#define GBT_SUM_COLUMNS {sum_columns}      /* numbers of a state that they depend on */
#define GBT_PARAMETERS {parameters}       /* parameters of the objective at each endpoint */
#define GBT_MOVING {moving}           /* parameters of the path constraints at each boundary of pieces */
#define GBT_END_NUMBERS {ends}       /* what becomes of them in coordinates relative to the start of the plan */
#define GBT_KNOT_NUMBERS {knots}      /* and of those of the constraints */
#define GBT_RELATIVE {relative}         /* 0 where the vehicle's dynamics depend on its place: all is absolute then */
#define GBT_LIMITS {limits}            /* path constraints */
#define GBT_COUNT {count}           /* bounds at all nodes: "sides" */
#define GBT_SIDES {sides}           /* the same, at least 1: for arrays */
#define GBT_JACOBIANS {jacobians}
#define GBT_PLACES {places}           /* places at which limits have nodes in all pieces, at least 1 */
#define GBT_SOFT {soft}            /* 1 where a limit is a penalty */
#define GBT_ROWS {rows}              /* values of a constraint at a node, at most */
#define GBT_ENTRIES {entries}          /* nonzeros of a Hessian at a node, at most */
#define GBT_NODES_MOST {nodes}        /* nodes of a limit in a piece, at most */
#define GBT_INPUTS {inputs}            /* inputs of the vehicle */
#define GBT_FINE_POINTS {fine}     /* points of a piece at which a finished trajectory is held against its limits */
#define GBT_MOMENTS {moments}           /* whether the moments of a forecast are all that the problem needs */
#define GBT_PRESENT {present}           /* 1 where its limits need them at the beginning of the plan too */

/* the default settings of the solver: what a gbt_settings is initialised with */
#define GBT_DEFAULT_SETTINGS \\
    {settings}

/* Which limits give for which, the last first, where they cannot all be kept: thrust never, those on what the vehicle
   knows of itself after those on what it believes of the target. */
typedef enum {{ GBT_THRUST, GBT_CERTAIN, GBT_BELIEVED }} gbt_limit_class;

/* A function of a point (of the flat form z, its rate and its acceleration; else state and inputs) and of what else it
   needs. */
typedef void (*gbt_function)(const gbt_real *point, const gbt_real *second, const gbt_real *third, gbt_real *out);

/* Row or column of an entry of the lower triangle of a matrix over the numbers of a point. */
typedef unsigned char gbt_index;

typedef struct {{
    gbt_function value;    /* (point, numbers) -> term of the objective, to be maximised, and what the sums gain */
    gbt_function gradient; /* (point, numbers, worth) -> all entries, of these, each times what it is worth */
    gbt_function hessian;  /* (point, numbers, weight) -> nonzeros of the lower triangle, the same with weights */
    int hessian_entries;
    const gbt_index *hessian_row, *hessian_column;
}} gbt_objective_functions;

#if GBT_SUMS
typedef struct {{
    gbt_function value, gradient, hessian; /* (sums) -> a term of the objective; all entries */
    gbt_function slopes; /* (point, numbers) -> of what is added to the sums, by each of so many columns of the state */
    const int *column;
}} gbt_sum_functions;
extern const gbt_sum_functions gbt_of_sums;
#endif

/* A constraint in units of its limits, imposed at times k T / intervals of every piece, k = first .. intervals. */
typedef struct {{
    int rows, sides, intervals, first, nodes, hard;
    gbt_limit_class kind;
    int given;                       /* at the start of the trajectory no plan can change it */
    int judged;                      /* a piece that breaks it is not executed */
    int steady;                      /* between its nodes it is never broken more than at them */
    int moved;                       /* it depends on the state at its nodes, which several steps lead to: its functions
                                        are of that state, its Jacobian is full, row by row */
    const int *row;                  /* of each side: which value is bounded, */
    const gbt_real *sign, *bound;    /* to be kept at sign * value <= bound, */
    const gbt_real *edge;            /* which may lie within the true limit, */
    const gbt_real *weight, *width;  /* the weight of a hard limit's class, or that of a penalty at an inner node and
                                        its half width */
    gbt_function value;              /* (place) -> values; a place is GBT_POINT and GBT_KNOT_NUMBERS numbers */
    gbt_function jacobian;           /* (place) -> nonzeros, in which J is given below */
    gbt_function pull;               /* (J, row) -> J' row */
    gbt_function push;               /* (J, point) -> J point */
    gbt_function curvature;          /* (place, first and second, J) -> Hessian of first'value + J' diag(second) J */
    int jacobian_entries;
    int curvature_entries;           /* of the lower triangle */
    const gbt_index *curvature_row, *curvature_column;
#if GBT_SHOOTING
    const gbt_real *share; /* of a piece, at each node */
#else
    const int *place; /* of each node, among those of a piece */
#endif
}} gbt_limit;

extern const gbt_real gbt_input_scale[]; /* natural sizes of what is free in a piece */
extern const gbt_objective_functions gbt_objective;
extern const gbt_limit gbt_limits[];
#if !GBT_SHOOTING
/* Places in a piece at which limits have nodes, GBT_PLACES / GBT_PIECES: the share of the piece, and s seconds into it
   GBT_DEGREE + 1 numbers s^k / k!. */
extern const gbt_real gbt_place_share[], gbt_place_taylor[];
#endif
extern const char *const gbt_limit_names[]; /* in the same order */
extern const gbt_real gbt_thrust_min[GBT_INPUTS], gbt_thrust_max[GBT_INPUTS];

#if GBT_SHOOTING
/* A piece is its state and inputs: the state at its end; all derivatives of that, one row a state; the nonzeros of the
   lower triangle of the Hessian of its product with a multiplier. */
void gbt_stage(const gbt_real *piece, const gbt_real *second, const gbt_real *third, gbt_real *state);
#if GBT_STEPS > 1
/* The same of one Runge-Kutta step from one share of the piece to another, of what moves of the state. */
void gbt_flow(const gbt_real *piece, const gbt_real *span, const gbt_real *third, gbt_real *state);
void gbt_flow_slopes(const gbt_real *piece, const gbt_real *span, const gbt_real *third, gbt_real *slopes);
void gbt_flow_curvature(const gbt_real *piece, const gbt_real *multiplier, const gbt_real *span, gbt_real *entries);
extern const int gbt_flow_entries;
extern const gbt_index gbt_flow_row[], gbt_flow_column[];
#else
void gbt_stage_slopes(const gbt_real *piece, const gbt_real *second, const gbt_real *third, gbt_real *slopes);
void gbt_stage_curvature(const gbt_real *piece, const gbt_real *multiplier, const gbt_real *third, gbt_real *entries);
#endif
extern const int gbt_stage_entries;
extern const gbt_index gbt_stage_row[], gbt_stage_column[];
/* Flat output and its rate at a piece's beginning. */
void gbt_stage_point(const gbt_real *piece, const gbt_real *second, const gbt_real *third, gbt_real *point);
/* Inputs of the last resort at its state, GBT_INPUTS; the idle ones, where a cold solve begins; and how far inputs may
   change over a piece, from those that GBT_LAST begins in its state; huge where their rates are not limited. */
void gbt_last_resort(const gbt_real *piece, const gbt_real *second, const gbt_real *third, gbt_real *inputs);
extern const gbt_real gbt_idle[GBT_INPUTS], gbt_input_step[GBT_INPUTS];
/* The inputs after a share of a piece. */
void gbt_stage_inputs(const gbt_real *piece, const gbt_real *share, const gbt_real *third, gbt_real *inputs);
#else
extern const gbt_real gbt_acceleration_scale[GBT_FLAT]; /* typical acceleration under full thrust */
void gbt_vehicle_inputs(const gbt_real *point, const gbt_real *second, const gbt_real *third, gbt_real *inputs);
/* The acceleration under a thrust, from z and its rate. */
void gbt_vehicle_acceleration(const gbt_real *z, const gbt_real *dz, const gbt_real *inputs, gbt_real *ddz);
#endif
/* The numbers of the objective at an endpoint and of the path constraints at a boundary of the pieces, relative to an
   origin, from their parameters; see gbt_places.h. */
void gbt_end_numbers(const double *origin, const double *parameters, const double *third, double *numbers);
void gbt_knot_numbers(const double *origin, const double *moving, const double *third, double *numbers);
#if GBT_MOMENTS
/* Parameters of the objective at an endpoint, from mean, symmetric root of the covariance and desired bearing. */
void gbt_prepare(const double *mean, const double *root, const double *desired, double *parameters);
#if GBT_PRESENT
/* Parameters of the path constraints at a boundary of the pieces, from mean and covariance there, and from the past:
   the covariance at the beginning of the plan, the mean at the boundary before (at the beginning the one there), and 0
   at the beginning or 1 after it. */
void gbt_prepare_limits(const double *mean, const double *covariance, const double *past, double *moving);
#endif
#endif

GBT_END_C

#endif
"""
"""What :func:`gbt_ocp.ocp.codegen.problem_source.generate_problem` fills in."""

FLAT_FORM = """#define GBT_SHOOTING 0
#define GBT_STEPS 1
#define GBT_DEGREE {degree}            /* L, degree of the polynomials */
#define GBT_JOINED {joined}            /* derivatives 0 .. that a piece takes over from the one before */
#define GBT_REMEMBERED {remembered}        /* 1 where a piece knows the lowest free derivative of the one before */
#define GBT_SEEN {seen}              /* derivatives 0 .. that objective and limits look at at a point */
#define GBT_TAYLOR {taylor} /* T^k / k!: what is in a derivative at the end of a piece of the one k above it */
"""
"""Sizes of the flat form."""

SHOOTING_FORM = """#define GBT_SHOOTING 1
#define GBT_STATES {states}           /* of the vehicle, and the inputs of the piece before where rates are limited: */
#define GBT_LAST {last}             /* which begin here; GBT_STATES where there are none */
#define GBT_STEPS {steps}            /* Runge-Kutta steps over a piece */
#define GBT_HELD {held}             /* unknowns of a piece: its inputs, or those at both of its ends */
#define GBT_BOX {box}              /* the limit that is bounds of what is free in a piece; -1 where there is none */
#define GBT_COST_AT_END {at_end}      /* whether the objective reads the state at the end of a piece alone */
"""
"""Sizes of a trajectory by integration."""
