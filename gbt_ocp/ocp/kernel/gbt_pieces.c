#include "gbt_pieces.h"

#include "gbt_coupling.h"
#include "gbt_math.h"

void gbt_taylor(gbt_real s, gbt_real power[GBT_ORDERS])
{
    power[0] = 1;
    for (int k = 1; k < GBT_ORDERS; k++) power[k] = power[k - 1] * s / (gbt_real)k;
}

static void point_at(gbt_piece piece, const gbt_real *power, gbt_real *point)
{
    for (int o = 0; o < 3; o++)
        for (int j = 0; j < GBT_FLAT; j++) {
            gbt_real value = piece[o][j];
            for (int k = 1; o + k < GBT_ORDERS; k++) value += power[k] * piece[o + k][j];
            point[o * GBT_FLAT + j] = value;
        }
}

static void add_transposed(const gbt_real *power, const gbt_real *point, gbt_piece piece)
{
    for (int o = 0; o < 3; o++)
        for (int k = 0; o + k < GBT_ORDERS; k++)
            for (int j = 0; j < GBT_FLAT; j++) piece[o + k][j] += power[k] * point[o * GBT_FLAT + j];
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

/* What a limit looks at: the point of piece i after a share of it, and the limit's numbers there. */
static void place_at(const gbt_workspace *work, gbt_piece piece[], int i, gbt_real share,
                     const gbt_real *power, gbt_real *place)
{
    point_at(piece[i], power, place);
    gbt_moving_at(work->moving + i * GBT_KNOT_NUMBERS, share, place);
}

void gbt_next_piece(gbt_piece piece, gbt_piece next)
{
    gbt_real power[GBT_ORDERS];
    gbt_taylor(GBT_PERIOD, power);
    for (int o = 0; o < GBT_JOINED; o++)
        for (int j = 0; j < GBT_FLAT; j++) {
            gbt_real value = piece[o][j];
            for (int k = 1; o + k < GBT_ORDERS; k++) value += power[k] * piece[o + k][j];
            next[o][j] = value;
        }
}

void gbt_propagate(gbt_piece piece[], int pieces)
{
    for (int i = 1; i < pieces; i++) gbt_next_piece(piece[i - 1], piece[i]);
}

void gbt_settle(gbt_piece piece, int first, const gbt_real *aim)
{
    /* The gains that bring a chain of so many integrators to rest in as many steps of one second (all poles at zero). */
    static const gbt_real gain[4][4] = {
        {1},
        {1, (gbt_real)3 / 2},
        {1, 2, (gbt_real)11 / 6},
        {1, (gbt_real)5 / 2, (gbt_real)35 / 12, (gbt_real)25 / 12},
    };
    const int inherited = GBT_JOINED - first;
    for (int j = 0; j < GBT_FLAT; j++) {
        gbt_real value = inherited == 0 ? aim[j] : 0;
        for (int i = 0; i < inherited; i++)
            value -= gain[inherited - 1][i] * (piece[first + i][j] - (i == 0 ? aim[j] : 0)) /
                     gbt_pow(GBT_PERIOD, (gbt_real)(inherited - i));
        piece[GBT_JOINED][j] = value;
    }
}

void gbt_coast(const gbt_real *start, gbt_real aside, gbt_real *top)
{
    gbt_piece piece;
    gbt_real aim[GBT_FLAT];
    for (int j = 0; j < GBT_FLAT; j++) aim[j] = aside / gbt_sqrt((gbt_real)(j + 1)) * gbt_acceleration_scale[j];
    for (int a = 0; a < GBT_STATE; a++) piece[a / GBT_FLAT][a % GBT_FLAT] = start[a];
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = 0;
    for (int i = 0; i < GBT_PIECES; i++) {
        gbt_settle(piece, 2, aim);
        for (int a = 0; a < GBT_FREE; a++) top[i * GBT_FREE + a] = *gbt_free(piece, a);
        gbt_next_piece(piece, piece);
    }
}

/* A piece depends linearly on the one before: its adjoint is the same everywhere. */
void gbt_adjoint(const gbt_workspace *work, gbt_piece gradient[], gbt_real out[][GBT_FREE])
{
    const int pieces = work->pieces;
    gbt_real power[GBT_ORDERS];
    gbt_taylor(GBT_PERIOD, power);
    for (int i = pieces - 1; i >= 0; i--) {
        for (int a = 0; a < GBT_FREE; a++) out[i][a] = *gbt_free(gradient[i], a);
        for (int o = 0; o < GBT_JOINED && i > 0; o++)
            for (int k = 0; o + k < GBT_ORDERS; k++)
                for (int j = 0; j < GBT_FLAT; j++) gradient[i - 1][o + k][j] += power[k] * gradient[i][o][j];
    }
}

/* It coasts. */
void gbt_lengthen(const gbt_real *last, gbt_real *added)
{
    (void)last;
    for (int a = 0; a < GBT_FREE; a++) added[a] = 0;
}

void gbt_add_terms(gbt_piece piece, const gbt_real *numbers, gbt_real *total)
{
    gbt_real point[GBT_POINT], value[GBT_TERMS];
    gbt_point_after(piece, GBT_PERIOD, point);
    gbt_objective.value(point, numbers, 0, value);
    for (int k = 0; k < GBT_TERMS; k++) total[k] += value[k];
}

void gbt_total(const gbt_workspace *work, gbt_piece piece[], gbt_real *total)
{
    gbt_real power[GBT_ORDERS], point[GBT_POINT], value[GBT_TERMS];
    gbt_taylor(GBT_PERIOD, power);
    for (int k = 0; k < GBT_TERMS; k++) total[k] = work->before[k];
    for (int i = 0; i < work->pieces; i++) {
        point_at(piece[i], power, point);
        gbt_objective.value(point, work->parameters + i * GBT_END_NUMBERS, 0, value);
        for (int k = 0; k < GBT_TERMS; k++) total[k] += value[k];
    }
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

gbt_real gbt_evaluate(const gbt_workspace *work, gbt_piece piece[], gbt_real *y)
{
    gbt_real power[GBT_ORDERS], point[GBT_PLACE], value[GBT_ROWS], total[GBT_TERMS];
    gbt_total(work, piece, total);
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = limit->first; k <= limit->intervals; k++) {
            const gbt_real share = (gbt_real)k / (gbt_real)limit->intervals;
            gbt_taylor(GBT_PERIOD * share, power);
            for (int i = 0; i < work->pieces; i++) {
                place_at(work, piece, i, share, power, point);
                limit->value(point, 0, 0, value);
                for (int r = 0; r < limit->sides; r++)
                    *y++ = limit->sign[r] * value[limit->row[r]] - limit->bound[r] + work->tightening[q];
            }
        }
    }
    return -gbt_gain(total);
}

void gbt_differentiate(gbt_workspace *work)
{
    gbt_real power[GBT_ORDERS], point[GBT_PLACE], slope[GBT_POINT];
    gbt_real *jacobian = work->jacobian;
    gbt_value_sums(work);
    gbt_taylor(GBT_PERIOD, power);
    for (int i = 0; i < work->pieces; i++) {
        point_at(work->piece[i], power, point);
        gbt_objective.gradient(point, work->parameters + i * GBT_END_NUMBERS, work->worth, slope);
        for (int a = 0; a < GBT_POINT; a++) slope[a] = -slope[a];
        for (int l = 0; l < GBT_ORDERS; l++)
            for (int j = 0; j < GBT_FLAT; j++) work->gradient[i][l][j] = 0;
        add_transposed(power, slope, work->gradient[i]);
    }
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = limit->first; k <= limit->intervals; k++) {
            const gbt_real share = (gbt_real)k / (gbt_real)limit->intervals;
            gbt_taylor(GBT_PERIOD * share, power);
            for (int i = 0; i < work->pieces; i++) {
                place_at(work, work->piece, i, share, power, point);
                limit->jacobian(point, 0, 0, jacobian);
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

void gbt_pull_back(const gbt_workspace *work, const gbt_real *sides, gbt_piece out[])
{
    gbt_real power[GBT_ORDERS], row[GBT_ROWS], slope[GBT_POINT];
    const gbt_real *jacobian = work->jacobian;
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = limit->first; k <= limit->intervals; k++) {
            gbt_taylor(GBT_PERIOD * (gbt_real)k / (gbt_real)limit->intervals, power);
            for (int i = 0; i < work->pieces; i++) {
                for (int r = 0; r < limit->rows; r++) row[r] = 0;
                for (int r = 0; r < limit->sides; r++) row[limit->row[r]] += limit->sign[r] * sides[r];
                for (int a = 0; a < GBT_POINT; a++) slope[a] = 0;
                for (int a = 0; a < limit->jacobian_entries; a++)
                    slope[limit->jacobian_column[a]] += jacobian[a] * row[limit->jacobian_row[a]];
                add_transposed(power, slope, out[i]);
                sides += limit->sides;
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

void gbt_push_forward(gbt_workspace *work)
{
    gbt_real power[GBT_ORDERS], row[GBT_ROWS], point[GBT_POINT];
    gbt_real *dy = work->dy;
    const gbt_real *jacobian = work->jacobian;
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = limit->first; k <= limit->intervals; k++) {
            gbt_taylor(GBT_PERIOD * (gbt_real)k / (gbt_real)limit->intervals, power);
            for (int i = 0; i < work->pieces; i++) {
                point_at(work->step[i], power, point);
                for (int r = 0; r < limit->rows; r++) row[r] = 0;
                for (int a = 0; a < limit->jacobian_entries; a++)
                    row[limit->jacobian_row[a]] += jacobian[a] * point[limit->jacobian_column[a]];
                for (int r = 0; r < limit->sides; r++) *dy++ = limit->sign[r] * row[limit->row[r]];
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

/* Adds a symmetric matrix at one point, given by the entries of its lower triangle, to the one of a piece: the half
   below the diagonal counts twice, so half of the diagonal and all below it make a matrix whose sum with its transpose
   is the result. That sum is left to the end of the piece. */
static void add_half(const gbt_real *power, const gbt_real *entry, int entries, const int *rows, const int *columns,
                     gbt_real half[GBT_PIECE][GBT_PIECE])
{
    for (int a = 0; a < entries; a++) {
        const gbt_real value = rows[a] == columns[a] ? entry[a] / 2 : entry[a];
        const gbt_real *first = power;
        for (int row = rows[a]; row < GBT_PIECE; row += GBT_FLAT) {
            const gbt_real part = *first++ * value, *second = power;
            for (int column = columns[a]; column < GBT_PIECE; column += GBT_FLAT) half[row][column] += part * *second++;
        }
    }
}

void gbt_assemble(gbt_workspace *work)
{
    gbt_real power[GBT_ORDERS], point[GBT_PLACE], entry[GBT_ENTRIES], first[GBT_ROWS], second[GBT_ROWS];
    const gbt_real *lambda = work->lambda, *sigma = work->sigma;
    gbt_real weight[GBT_TERMS];
    for (int k = 0; k < GBT_TERMS; k++) weight[k] = -work->worth[k];

    gbt_taylor(GBT_PERIOD, power);
    for (int i = 0; i < work->pieces; i++) {
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c < GBT_PIECE; c++) work->curvature[i][a][c] = 0;
        point_at(work->piece[i], power, point);
        gbt_objective.hessian(point, work->parameters + i * GBT_END_NUMBERS, weight, entry);
        add_half(power, entry, gbt_objective.hessian_entries, gbt_objective.hessian_row, gbt_objective.hessian_column,
                 work->curvature[i]);
    }
    for (int q = 0; q < GBT_LIMITS; q++) {
        const gbt_limit *limit = &gbt_limits[q];
        for (int k = limit->first; k <= limit->intervals; k++) {
            const gbt_real share = (gbt_real)k / (gbt_real)limit->intervals;
            gbt_taylor(GBT_PERIOD * share, power);
            for (int i = 0; i < work->pieces; i++) {
                for (int r = 0; r < limit->rows; r++) first[r] = second[r] = 0;
                for (int r = 0; r < limit->sides; r++) {
                    first[limit->row[r]] += limit->sign[r] * *lambda++;
                    second[limit->row[r]] += *sigma++;
                }
                place_at(work, work->piece, i, share, power, point);
                limit->curvature(point, first, second, entry);
                add_half(power, entry, limit->curvature_entries, limit->curvature_row, limit->curvature_column,
                         work->curvature[i]);
            }
        }
    }
    for (int i = 0; i < work->pieces; i++)
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c <= a; c++)
                work->curvature[i][a][c] = work->curvature[i][c][a] =
                    work->curvature[i][a][c] + work->curvature[i][c][a];
}

#if GBT_SUMS
void gbt_end_point(gbt_workspace *work, int i, gbt_real *point)
{
    gbt_point_after(work->piece[i], GBT_PERIOD, point);
}
#endif
