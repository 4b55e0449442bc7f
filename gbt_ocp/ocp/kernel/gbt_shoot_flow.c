/* Pieces of several Runge-Kutta steps: the state and its derivatives, step after step by the chain rule.

   Written out in one expression, several steps make functions that no compiler is done with. One step is generated
   (gbt_flow); here it is taken GBT_STEPS times. Along a piece the inputs of the piece before stay what they were; the
   other GBT_LAST numbers of the state move. */
#include "gbt_form.h"

#if GBT_STEPS > 1

static void span_of(int k, gbt_real *span)
{
    span[0] = (gbt_real)k / (gbt_real)GBT_STEPS;
    span[1] = (gbt_real)(k + 1) / (gbt_real)GBT_STEPS;
}

static void move(gbt_real *at, const gbt_real *span)
{
    gbt_real next[GBT_LAST];
    gbt_flow(at, span, 0, next);
    for (int a = 0; a < GBT_LAST; a++) at[a] = next[a];
}

void gbt_state_after(gbt_piece piece, gbt_real share, gbt_real *at)
{
    gbt_real span[2];
    for (int a = 0; a < GBT_PIECE; a++) at[a] = piece[a];
    for (int k = 0; k < GBT_STEPS; k++) {
        span_of(k, span);
        if (!(span[0] < share)) break;
        if (span[1] > share) span[1] = share;
        move(at, span);
    }
}

void gbt_passed_states(gbt_piece piece, gbt_real states[GBT_STEPS + 1][GBT_LAST])
{
    gbt_real at[GBT_PIECE], span[2];
    for (int a = 0; a < GBT_PIECE; a++) at[a] = piece[a];
    for (int k = 0; k <= GBT_STEPS; k++) {
        for (int a = 0; a < GBT_LAST; a++) states[k][a] = at[a];
        span_of(k, span);
        if (k < GBT_STEPS) move(at, span);
    }
}

void gbt_stage(const gbt_real *piece, const gbt_real *second, const gbt_real *third, gbt_real *state)
{
    const gbt_real one = 1;
    gbt_real at[GBT_PIECE], inputs[GBT_INPUTS], span[2];
    (void)second;
    (void)third;
    for (int a = 0; a < GBT_PIECE; a++) at[a] = piece[a];
    gbt_stage_inputs(piece, &one, 0, inputs);
    for (int k = 0; k < GBT_STEPS; k++) {
        span_of(k, span);
        move(at, span);
    }
    for (int a = 0; a < GBT_STATE; a++) state[a] = a < GBT_LAST ? at[a] : inputs[a - GBT_LAST];
}

/* What the chain rule makes of derivatives for the numbers at a step, in a row: those for the numbers of the piece. */
void gbt_chained(gbt_real along[GBT_LAST][GBT_PIECE], gbt_real *row)
{
    gbt_real sum[GBT_PIECE];
    for (int c = 0; c < GBT_PIECE; c++) sum[c] = c < GBT_LAST ? 0 : row[c];
    for (int k = 0; k < GBT_LAST; k++) {
        if (row[k] == 0) continue;
        for (int c = 0; c < GBT_PIECE; c++) sum[c] += row[k] * along[k][c];
    }
    for (int c = 0; c < GBT_PIECE; c++) row[c] = sum[c];
}

void gbt_passed_slopes(gbt_piece piece, gbt_real states[GBT_STEPS + 1][GBT_LAST],
                       gbt_real along[GBT_STEPS + 1][GBT_LAST][GBT_PIECE])
{
    gbt_real at[GBT_PIECE], span[2];
    gbt_passed_states(piece, states);
    for (int a = 0; a < GBT_PIECE; a++) at[a] = piece[a];
    for (int r = 0; r < GBT_LAST; r++)
        for (int c = 0; c < GBT_PIECE; c++) along[0][r][c] = r == c;
    for (int k = 0; k < GBT_STEPS; k++) {
        for (int a = 0; a < GBT_LAST; a++) at[a] = states[k][a];
        span_of(k, span);
        gbt_flow_slopes(at, span, 0, &along[k + 1][0][0]);
        for (int r = 0; r < GBT_LAST; r++) gbt_chained(along[k], along[k + 1][r]);
    }
}

void gbt_end_slopes(gbt_real along[GBT_LAST][GBT_PIECE], gbt_real slopes[GBT_STATE][GBT_PIECE])
{
    for (int r = 0; r < GBT_STATE; r++)
        for (int c = 0; c < GBT_PIECE; c++)
            slopes[r][c] = r < GBT_LAST ? along[r][c] : c == GBT_PIECE - GBT_INPUTS + r - GBT_LAST;
}

/* out = W' in, W the derivatives of the numbers after a step for those before it, of which slopes has the rows of what
   moves; the others stay. Many of the slopes are zero. */
static void back_through(gbt_real slopes[GBT_LAST][GBT_PIECE], gbt_real in[GBT_PIECE][GBT_PIECE],
                         gbt_real out[GBT_PIECE][GBT_PIECE])
{
    for (int c = 0; c < GBT_PIECE; c++) {
        gbt_real row[GBT_PIECE];
        for (int a = 0; a < GBT_PIECE; a++) row[a] = c < GBT_LAST ? 0 : in[c][a];
        for (int k = 0; k < GBT_LAST; k++) {
            const gbt_real slope = slopes[k][c];
            if (slope == 0) continue;
            for (int a = 0; a < GBT_PIECE; a++) row[a] += slope * in[k][a];
        }
        for (int a = 0; a < GBT_PIECE; a++) out[c][a] = row[a];
    }
}

/* Second derivatives for the numbers after a step to those before it: W' matrix W, symmetric. */
static void square_through(gbt_real slopes[GBT_LAST][GBT_PIECE], gbt_real matrix[GBT_PIECE][GBT_PIECE])
{
    gbt_real half[GBT_PIECE][GBT_PIECE], turned[GBT_PIECE][GBT_PIECE];
    back_through(slopes, matrix, half);
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c < GBT_PIECE; c++) turned[a][c] = half[c][a];
    back_through(slopes, turned, matrix);
}

/* Adds entries of a lower triangle to a symmetric matrix. */
static void add_both(const gbt_real *entry, int entries, const gbt_index *rows, const gbt_index *columns,
                     gbt_real matrix[GBT_PIECE][GBT_PIECE])
{
    for (int e = 0; e < entries; e++) {
        matrix[rows[e]][columns[e]] += entry[e];
        if (rows[e] != columns[e]) matrix[columns[e]][rows[e]] += entry[e];
    }
}

/* The limits that look at the state after a step: their second derivatives there, and what their multipliers push. */
static void add_nodes(int step, gbt_real (*place)[GBT_PLACE], const gbt_real *lambda, const gbt_real *sigma,
                      gbt_real matrix[GBT_PIECE][GBT_PIECE], gbt_real *push)
{
    gbt_real weights[2 * GBT_ROWS], slopes[GBT_ROWS * GBT_PIECE], entry[GBT_ENTRIES];
    for (int q = 0; q < GBT_LIMITS && place; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = 0; k < limit->nodes; k++, place++, lambda += limit->sides, sigma += limit->sides) {
            if (!limit->moved || gbt_step_of(limit, k) != step) continue;
            gbt_side_weights(limit, lambda, sigma, weights);
            limit->jacobian(*place, 0, 0, slopes);
            limit->curvature(*place, weights, slopes, entry);
            add_both(entry, limit->curvature_entries, limit->curvature_row, limit->curvature_column, matrix);
            for (int r = 0; r < limit->rows; r++)
                for (int a = 0; a < GBT_LAST; a++) push[a] += weights[r] * slopes[r * GBT_PIECE + a];
        }
    }
}

/* From the last step to the first one, each time for the numbers before the step. */
void gbt_add_along_steps(gbt_workspace *work, int i, gbt_real (*place)[GBT_PLACE], const gbt_real *lambda,
                         const gbt_real *sigma)
{
    gbt_real limits[GBT_PIECE][GBT_PIECE], flow[GBT_PIECE][GBT_PIECE], slopes[GBT_LAST][GBT_PIECE];
    gbt_real push[GBT_LAST], at[GBT_PIECE], span[2], entry[GBT_ENTRIES];
    for (int a = 0; a < GBT_PIECE; a++) {
        at[a] = work->piece[i][a];
        for (int c = 0; c < GBT_PIECE; c++) limits[a][c] = flow[a][c] = 0;
    }
    for (int a = 0; a < GBT_LAST; a++) push[a] = work->pull[i + 1][a];
    add_nodes(GBT_STEPS, place, lambda, sigma, limits, push);
    for (int k = GBT_STEPS - 1; k >= 0; k--) {
        gbt_real before[GBT_LAST];
        for (int a = 0; a < GBT_LAST; a++) at[a] = work->passed[i][k][a];
        span_of(k, span);
        gbt_flow_slopes(at, span, 0, &slopes[0][0]);
        gbt_flow_curvature(at, push, span, entry);
        square_through(slopes, limits);
        square_through(slopes, flow);
        add_both(entry, gbt_flow_entries, gbt_flow_row, gbt_flow_column, flow);
        for (int c = 0; c < GBT_LAST; c++) {
            before[c] = 0;
            for (int r = 0; r < GBT_LAST; r++) before[c] += push[r] * slopes[r][c];
        }
        for (int c = 0; c < GBT_LAST; c++) push[c] = before[c];
        add_nodes(k, place, lambda, sigma, limits, push);
    }
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c <= a; c++) work->curvature[i][a][c] += limits[a][c];
    for (int e = 0; e < gbt_stage_entries; e++) work->bend[i][e] = flow[gbt_stage_row[e]][gbt_stage_column[e]];
}

#endif
