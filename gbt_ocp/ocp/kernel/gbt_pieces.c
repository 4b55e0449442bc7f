#include "gbt_pieces.h"

#include "gbt_coupling.h"
#include "gbt_math.h"

void gbt_taylor(gbt_real s, gbt_real power[GBT_ORDERS])
{
    power[0] = 1;
    for (int k = 1; k < GBT_DERIVATIVES; k++) power[k] = power[k - 1] * s / (gbt_real)k;
}

/* The same at the end of a piece. */
static const gbt_real at_end[GBT_DERIVATIVES] = GBT_TAYLOR;

static void point_at(gbt_piece piece, const gbt_real *power, gbt_real *point)
{
    for (int j = 0; j < GBT_FLAT; j++) {
        GBT_UNROLLED
        for (int o = 0; o < GBT_SEEN - GBT_REMEMBERED; o++) {
            gbt_real value = piece[GBT_ROW(o)][j];
            GBT_UNROLLED
            for (int k = 1; k < GBT_DERIVATIVES - o; k++) value += power[k] * piece[GBT_ROW(o + k)][j];
            point[o * GBT_FLAT + j] = value;
        }
    }
#if GBT_REMEMBERED
    for (int j = 0; j < GBT_FLAT; j++) point[3 * GBT_FLAT + j] = piece[GBT_JOINED][j];
#endif
}

static void add_transposed(const gbt_real *power, const gbt_real *point, gbt_piece piece)
{
    for (int j = 0; j < GBT_FLAT; j++) {
        gbt_real sum[GBT_DERIVATIVES];
        GBT_UNROLLED
        for (int l = 0; l < GBT_DERIVATIVES; l++) sum[l] = piece[GBT_ROW(l)][j];
        GBT_UNROLLED
        for (int o = 0; o < GBT_SEEN - GBT_REMEMBERED; o++) {
            GBT_UNROLLED
            for (int k = 0; k < GBT_DERIVATIVES - o; k++) sum[o + k] += power[k] * point[o * GBT_FLAT + j];
        }
        GBT_UNROLLED
        for (int l = 0; l < GBT_DERIVATIVES; l++) piece[GBT_ROW(l)][j] = sum[l];
    }
#if GBT_REMEMBERED
    for (int j = 0; j < GBT_FLAT; j++) piece[GBT_JOINED][j] += point[3 * GBT_FLAT + j];
#endif
}

void gbt_point_after(gbt_piece piece, gbt_real s, gbt_real *point)
{
    gbt_real power[GBT_ORDERS];
    gbt_taylor(s, power);
    point_at(piece, power, point);
}

void gbt_place_after(gbt_piece piece, gbt_real share, gbt_real *place)
{
    gbt_point_after(piece, GBT_PERIOD * share, place);
}

#define PLACES (GBT_PLACES / GBT_PIECES) /* in a piece */
#define TAYLOR_AT(place) (gbt_place_taylor + (place) * GBT_DERIVATIVES)

/* What limits look at in place number k of piece i: the point there, and the numbers of the limits. */
static void place_at(const gbt_workspace *work, gbt_piece piece[], int i, int k, gbt_real *place)
{
    point_at(piece[i], TAYLOR_AT(k), place);
    gbt_moving_at(work->moving + i * GBT_KNOT_NUMBERS, gbt_place_share[k], place);
}

void gbt_next_piece(gbt_piece piece, gbt_piece next)
{
    for (int o = 0; o < GBT_JOINED; o++)
        for (int j = 0; j < GBT_FLAT; j++) {
            gbt_real value = piece[o][j];
            for (int k = 1; o + k < GBT_DERIVATIVES; k++) value += at_end[k] * piece[GBT_ROW(o + k)][j];
            next[o][j] = value;
        }
#if GBT_REMEMBERED
    for (int j = 0; j < GBT_FLAT; j++) next[GBT_JOINED][j] = piece[GBT_ROW(GBT_JOINED)][j];
#endif
}

void gbt_propagate(gbt_piece piece[], int pieces)
{
    for (int i = 1; i < pieces; i++) gbt_next_piece(piece[i - 1], piece[i]);
}

/* A piece depends linearly on the one before: its adjoint is the same everywhere. */
void gbt_adjoint(const gbt_workspace *work, gbt_piece gradient[], gbt_real out[][GBT_FREE])
{
    for (int i = work->pieces - 1; i >= 0; i--) {
        for (int a = 0; a < GBT_FREE; a++) out[i][a] = *gbt_free(gradient[i], a);
        for (int o = 0; o < GBT_JOINED && i > 0; o++)
            for (int k = 0; o + k < GBT_DERIVATIVES; k++)
                for (int j = 0; j < GBT_FLAT; j++) gradient[i - 1][GBT_ROW(o + k)][j] += at_end[k] * gradient[i][o][j];
#if GBT_REMEMBERED
        for (int j = 0; j < GBT_FLAT && i > 0; j++) gradient[i - 1][GBT_ROW(GBT_JOINED)][j] += gradient[i][GBT_JOINED][j];
#endif
    }
}

void gbt_add_terms(gbt_piece piece, const gbt_real *numbers, gbt_real *total)
{
    gbt_real point[GBT_POINT], value[GBT_TERMS];
    point_at(piece, at_end, point);
    gbt_objective.value(point, numbers, 0, value);
    for (int k = 0; k < GBT_TERMS; k++) total[k] += value[k];
}

void gbt_total(const gbt_workspace *work, gbt_piece piece[], gbt_real *total)
{
    for (int k = 0; k < GBT_TERMS; k++) total[k] = work->before[k];
    for (int i = 0; i < work->pieces; i++) gbt_add_terms(piece[i], work->parameters + i * GBT_END_NUMBERS, total);
}

void gbt_inputs_after(gbt_piece piece, gbt_real share, gbt_real *inputs)
{
    gbt_real point[GBT_POINT];
    gbt_place_after(piece, share, point);
    gbt_vehicle_inputs(point, 0, 0, inputs);
}

void gbt_end_of(gbt_piece piece, gbt_real *z, gbt_real *dz)
{
    gbt_piece next;
    gbt_next_piece(piece, next);
    for (int j = 0; j < GBT_FLAT; j++) {
        z[j] = next[0][j];
        dz[j] = next[1][j];
    }
}

void gbt_try(gbt_workspace *work, gbt_real alpha)
{
    for (int i = 0; i < work->pieces; i++)
        for (int l = 0; l < GBT_ORDERS; l++)
            for (int j = 0; j < GBT_FLAT; j++)
                work->trial[i][l][j] = work->piece[i][l][j] + alpha * work->step[i][l][j];
}

gbt_real gbt_evaluate(gbt_workspace *work, gbt_piece piece[], gbt_real *y)
{
    gbt_real value[GBT_ROWS], total[GBT_TERMS], (*place)[GBT_PLACE] = work->place;
    gbt_total(work, piece, total);
    for (int i = 0; i < work->pieces; i++, place += PLACES) {
        for (int k = 0; k < PLACES; k++) place_at(work, piece, i, k, place[k]);
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            const gbt_real inside = work->first + i == 0 ? work->tightening[q] : 0;
            for (int k = 0; k < limit->nodes; k++) {
                limit->value(place[limit->place[k]], 0, 0, value);
                for (int r = 0; r < limit->sides; r++)
                    *y++ = limit->sign[r] * value[limit->row[r]] - limit->bound[r] + inside;
            }
        }
    }
    return -gbt_gain(total);
}

void gbt_differentiate(gbt_workspace *work)
{
    gbt_real end[GBT_POINT], slope[GBT_POINT], (*place)[GBT_PLACE] = work->place;
    gbt_real *jacobian = work->jacobian;
    gbt_value_sums(work);
    for (int i = 0; i < work->pieces; i++, place += PLACES) {
        point_at(work->piece[i], at_end, end);
        gbt_objective.gradient(end, work->parameters + i * GBT_END_NUMBERS, work->worth, slope);
        for (int a = 0; a < GBT_POINT; a++) slope[a] = -slope[a];
        for (int l = 0; l < GBT_ORDERS; l++)
            for (int j = 0; j < GBT_FLAT; j++) work->gradient[i][l][j] = 0;
        add_transposed(at_end, slope, work->gradient[i]);
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                limit->jacobian(place[limit->place[k]], 0, 0, jacobian);
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

void gbt_pull_back(const gbt_workspace *work, const gbt_real *sides, gbt_piece out[])
{
    gbt_real row[GBT_ROWS], slope[GBT_POINT];
    const gbt_real *jacobian = work->jacobian;
    for (int i = 0; i < work->pieces; i++) {
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                for (int r = 0; r < GBT_ROWS; r++) row[r] = 0;
                for (int r = 0; r < limit->sides; r++) row[limit->row[r]] += limit->sign[r] * sides[r];
                limit->pull(jacobian, row, 0, slope);
                add_transposed(TAYLOR_AT(limit->place[k]), slope, out[i]);
                sides += limit->sides;
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

void gbt_push_forward(gbt_workspace *work)
{
    gbt_real row[GBT_ROWS], point[PLACES][GBT_POINT];
    gbt_real *dy = work->step_of.dy;
    const gbt_real *jacobian = work->jacobian;
    for (int i = 0; i < work->pieces; i++) {
        for (int k = 0; k < PLACES; k++) point_at(work->step[i], TAYLOR_AT(k), point[k]);
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                limit->push(jacobian, point[limit->place[k]], 0, row);
                for (int r = 0; r < limit->sides; r++) *dy++ = limit->sign[r] * row[limit->row[r]];
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

#define POWERS (2 * GBT_DEGREE + 1)

/* Of derivative o at a point: how many from it on at the beginning of the piece lead to it, and the number in the piece of
   one of them, so far above the entry of the point with this number. */
static int later(int o) { return GBT_REMEMBERED && o == 3 ? 1 : GBT_DERIVATIVES - o; }

static inline int number_above(int number, int above)
{
    const int o = number / GBT_FLAT;
    if (!GBT_REMEMBERED) return number + above * GBT_FLAT;
    return (o == 3 ? GBT_JOINED : GBT_ROW(o + above)) * GBT_FLAT + number % GBT_FLAT;
}

/* The sums of an entry over the points times so many powers of the time; the next point has GBT_ENTRIES of its own. */
static inline void sum_up(const gbt_real *entry, int points, const gbt_real *seconds, int count, gbt_real *sum)
{
    gbt_real total[POWERS] = {0}, part = entry[0];
    total[0] = part;
    GBT_UNROLLED
    for (int d = 1; d < count; d++) total[d] = part *= seconds[0];
    for (int k = 1; k < points; k++) {
        const gbt_real s = seconds[k];
        part = *(entry += GBT_ENTRIES);
        total[0] += part;
        GBT_UNROLLED
        for (int d = 1; d < count; d++) total[d] += part *= s;
    }
    GBT_UNROLLED
    for (int d = 0; d < count; d++) sum[d] = total[d];
}

/* Curvatures are symmetric matrices over the numbers of a point, of which some entries of the lower triangle are given.
   Derivative l at the beginning of the piece is s^(l-o) / (l-o)! of derivative o at a point s seconds into it. So all that
   the matrix of the piece needs of an entry is its sum over the points times s^0, s^1, ..., as far as there are
   derivatives. An entry is added on one side of the diagonal or on both, as its numbers lie: the matrix is what is filled
   here plus its transpose. */
static void add_entry(int row, int column, const gbt_real *first, int points, const gbt_real *seconds,
                      gbt_real over_factorials[GBT_DERIVATIVES][GBT_DERIVATIVES], gbt_real matrix[GBT_PIECE][GBT_PIECE])
{
    const int up = later(row / GBT_FLAT), across = later(column / GBT_FLAT), count = up + across - 1;
    gbt_real sum[POWERS];
    /* of a constant number, sums stay in registers */
    switch (count) {
    case 1: sum_up(first, points, seconds, 1, sum); break;
    case 2: sum_up(first, points, seconds, 2, sum); break;
    case 3: sum_up(first, points, seconds, 3, sum); break;
    case 4: sum_up(first, points, seconds, 4, sum); break;
    case 5: sum_up(first, points, seconds, 5, sum); break;
    default: sum_up(first, points, seconds, count, sum);
    }
    if (row == column) /* both sides are one */
        for (int d = 0; d < count; d++) sum[d] /= 2;
    for (int i = 0; i < up; i++) {
        gbt_real *to = matrix[number_above(row, i)];
        for (int k = 0; k < across; k++) to[number_above(column, k)] += over_factorials[i][k] * sum[i + k];
    }
}

void gbt_assemble(gbt_workspace *work)
{
    static const gbt_real period = GBT_PERIOD;
    gbt_real end[GBT_POINT], entry[GBT_NODES_MOST][GBT_ENTRIES], weights[2 * GBT_ROWS], (*place)[GBT_PLACE] = work->place;
    gbt_real seconds[GBT_NODES_MOST], over_factorial[GBT_ORDERS], over_factorials[GBT_DERIVATIVES][GBT_DERIVATIVES];
    gbt_real weight[GBT_TERMS];
    const gbt_real *lambda = work->lambda, *sigma = work->sigma, *jacobian = work->jacobian;
    for (int k = 0; k < GBT_TERMS; k++) weight[k] = -work->worth[k];
    gbt_taylor(1, over_factorial);
    for (int l = 0; l < GBT_DERIVATIVES; l++)
        for (int o = 0; o < GBT_DERIVATIVES; o++) over_factorials[l][o] = over_factorial[l] * over_factorial[o];
    for (int i = 0; i < work->pieces; i++, place += PLACES) {
        gbt_real (*matrix)[GBT_PIECE] = work->curvature[i];
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c < GBT_PIECE; c++) matrix[a][c] = 0;
        point_at(work->piece[i], at_end, end);
        gbt_objective.hessian(end, work->parameters + i * GBT_END_NUMBERS, weight, entry[0]);
        for (int a = 0; a < gbt_objective.hessian_entries; a++)
            add_entry(gbt_objective.hessian_row[a], gbt_objective.hessian_column[a], &entry[0][a], 1, &period, over_factorials,
                      matrix);
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                for (int r = 0; r < 2 * GBT_ROWS; r++) weights[r] = 0;
                for (int r = 0; r < limit->sides; r++) {
                    weights[limit->row[r]] += limit->sign[r] * *lambda++;
                    weights[limit->rows + limit->row[r]] += *sigma++;
                }
                limit->curvature(place[limit->place[k]], weights, jacobian, entry[k]);
                seconds[k] = TAYLOR_AT(limit->place[k])[1];
                jacobian += limit->jacobian_entries;
            }
            for (int a = 0; a < limit->curvature_entries; a++)
                add_entry(limit->curvature_row[a], limit->curvature_column[a], &entry[0][a], limit->nodes, seconds,
                          over_factorials, matrix);
        }
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c <= a; c++) matrix[a][c] = matrix[c][a] = matrix[a][c] + matrix[c][a];
    }
}

#if GBT_SUMS
void gbt_end_point(gbt_workspace *work, int i, gbt_real *point) { point_at(work->piece[i], at_end, point); }
#endif
