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
    for (int k = 0; k < GBT_LAST; k++)
        for (int c = 0; c < GBT_PIECE; c++) sum[c] += row[k] * along[k][c];
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

/* matrix += W' H W in the lower triangle, W the derivatives of the numbers at a step. Entries of H are of its lower
   triangle. */
void gbt_add_chained(gbt_real along[GBT_LAST][GBT_PIECE], const gbt_real *entry, int entries, const int *rows,
                     const int *columns, gbt_real matrix[GBT_PIECE][GBT_PIECE])
{
    gbt_real product[GBT_PIECE][GBT_PIECE]; /* H W */
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c < GBT_PIECE; c++) product[a][c] = 0;
    for (int e = 0; e < entries; e++) {
        product[rows[e]][columns[e]] += entry[e];
        if (rows[e] != columns[e]) product[columns[e]][rows[e]] += entry[e];
    }
    for (int a = 0; a < GBT_PIECE; a++) gbt_chained(along, product[a]);
    for (int a = 0; a < GBT_PIECE; a++)
        for (int c = 0; c <= a; c++) {
            gbt_real sum = a < GBT_LAST ? 0 : product[a][c];
            for (int k = 0; k < GBT_LAST; k++) sum += along[k][a] * product[k][c];
            matrix[a][c] += sum;
        }
}

void gbt_flow_bend(gbt_piece piece, gbt_real states[GBT_STEPS + 1][GBT_LAST],
                   gbt_real along[GBT_STEPS + 1][GBT_LAST][GBT_PIECE], gbt_real push[GBT_STEPS + 1][GBT_LAST],
                   gbt_real *bend)
{
    gbt_real at[GBT_PIECE], span[2], entry[GBT_ENTRIES], slopes[GBT_LAST][GBT_PIECE], sum[GBT_PIECE][GBT_PIECE];
    for (int a = 0; a < GBT_PIECE; a++) {
        at[a] = piece[a];
        for (int c = 0; c < GBT_PIECE; c++) sum[a][c] = 0;
    }
    for (int k = GBT_STEPS - 1; k >= 0; k--) {
        for (int a = 0; a < GBT_LAST; a++) at[a] = states[k][a];
        span_of(k, span);
        gbt_flow_curvature(at, push[k + 1], span, entry);
        gbt_add_chained(along[k], entry, gbt_flow_entries, gbt_flow_row, gbt_flow_column, sum);
        gbt_flow_slopes(at, span, 0, &slopes[0][0]);
        for (int r = 0; r < GBT_LAST; r++)
            for (int c = 0; c < GBT_LAST; c++) push[k][c] += push[k + 1][r] * slopes[r][c];
    }
    for (int e = 0; e < gbt_stage_entries; e++) bend[e] = sum[gbt_stage_row[e]][gbt_stage_column[e]];
}

#endif
