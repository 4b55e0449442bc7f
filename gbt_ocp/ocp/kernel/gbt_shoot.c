/* The form of a trajectory that follows from the inputs by integration: every trajectory obeys the dynamics. */
#include "gbt_form.h"

#include "gbt_coupling.h"
#include "gbt_math.h"

void gbt_place_after(gbt_piece piece, gbt_real share, gbt_real *place)
{
#if GBT_STEPS > 1
    gbt_state_after(piece, share, place);
#else
    for (int a = 0; a < GBT_PIECE; a++) place[a] = piece[a];
#endif
    place[GBT_PIECE] = share;
}

#if GBT_STEPS > 1
typedef gbt_real (*passed_states)[GBT_STEPS + 1][GBT_LAST];
#else
typedef void *passed_states;
#endif

/* What a limit looks at in its node k of piece i, where the states after the steps are known. */
static void place_at_node(const gbt_workspace *work, gbt_piece piece, passed_states passed, int i,
                          const gbt_limit *limit, int k, gbt_real *place)
{
    for (int a = 0; a < GBT_PIECE; a++) place[a] = piece[a];
    place[GBT_PIECE] = limit->share[k];
#if GBT_STEPS > 1
    if (limit->moved)
        for (int a = 0; a < GBT_LAST; a++) place[a] = passed[i][gbt_step_of(limit, k)][a];
#else
    (void)passed;
#endif
    gbt_moving_at(work->moving + i * GBT_KNOT_NUMBERS, limit->share[k], place);
}

void gbt_next_piece(gbt_piece piece, gbt_piece next)
{
    gbt_real state[GBT_STATE];
    gbt_stage(piece, 0, 0, state);
    for (int a = 0; a < GBT_STATE; a++) next[a] = state[a];
}

/* Fills the state at the end, too, whose inputs are zero: there are none. */
void gbt_propagate(gbt_piece piece[], int pieces)
{
    for (int i = 0; i < pieces; i++) gbt_stage(piece[i], 0, 0, piece[i + 1]);
    for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece[pieces], a) = 0;
}

/* What the objective of a piece looks at: the state at its end, or its beginning and inputs. */
static gbt_real *seen_by_objective(gbt_piece piece[], int i) { return piece[i + GBT_COST_AT_END]; }

void gbt_add_terms(gbt_piece piece, const gbt_real *numbers, gbt_real *total)
{
    gbt_piece seen;
    gbt_real value[GBT_TERMS];
    for (int a = 0; a < GBT_PIECE; a++) seen[a] = piece[a];
    if (GBT_COST_AT_END) gbt_next_piece(piece, seen);
    gbt_objective.value(seen, numbers, 0, value);
    for (int k = 0; k < GBT_TERMS; k++) total[k] += value[k];
}

void gbt_total(const gbt_workspace *work, gbt_piece piece[], gbt_real *total)
{
    gbt_real value[GBT_TERMS];
    for (int k = 0; k < GBT_TERMS; k++) total[k] = work->before[k];
    for (int i = 0; i < work->pieces; i++) {
        gbt_objective.value(seen_by_objective(piece, i), work->parameters + i * GBT_END_NUMBERS, 0, value);
        for (int k = 0; k < GBT_TERMS; k++) total[k] += value[k];
    }
}

void gbt_inputs_after(gbt_piece piece, gbt_real share, gbt_real *inputs) { gbt_stage_inputs(piece, &share, 0, inputs); }

void gbt_end_of(gbt_piece piece, gbt_real *z, gbt_real *dz)
{
    gbt_piece next;
    gbt_real point[2 * GBT_FLAT];
    for (int a = 0; a < GBT_PIECE; a++) next[a] = piece[a];
    gbt_next_piece(piece, next);
    gbt_stage_point(next, 0, 0, point);
    for (int j = 0; j < GBT_FLAT; j++) {
        z[j] = point[j];
        dz[j] = point[GBT_FLAT + j];
    }
}

void gbt_adjoint(const gbt_workspace *work, gbt_piece gradient[], gbt_real out[][GBT_FREE])
{
    for (int i = work->pieces - 1; i >= 0; i--) {
        gbt_real sum[GBT_PIECE];
        for (int a = 0; a < GBT_PIECE; a++) sum[a] = gradient[i][a];
        for (int r = 0; r < GBT_STATE; r++)
            for (int a = 0; a < GBT_PIECE; a++) sum[a] += gradient[i + 1][r] * work->slopes[i][r][a];
        for (int a = 0; a < GBT_STATE; a++) gradient[i][a] = sum[a];
        for (int a = 0; a < GBT_FREE; a++) out[i][a] = sum[GBT_STATE + a];
    }
}

gbt_real gbt_evaluate(gbt_workspace *work, gbt_piece piece[], gbt_real *y)
{
    gbt_real value[GBT_ROWS], total[GBT_TERMS], (*place)[GBT_PLACE] = work->place;
#if GBT_STEPS > 1
    gbt_real states[GBT_PIECES][GBT_STEPS + 1][GBT_LAST], (*passed)[GBT_STEPS + 1][GBT_LAST] = states;
    for (int i = 0; i < work->pieces; i++) gbt_passed_states(piece[i], states[i]);
#else
    passed_states passed = 0;
#endif
    gbt_total(work, piece, total);
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            const gbt_real inside = work->first + i == 0 ? work->tightening[q] : 0;
            for (int k = 0; k < limit->nodes; k++, place++) {
                place_at_node(work, piece[i], passed, i, limit, k, *place);
                limit->value(*place, 0, 0, value);
                for (int r = 0; r < limit->sides; r++)
                    *y++ = limit->sign[r] * value[limit->row[r]] - limit->bound[r] + inside;
            }
        }
    return -gbt_gain(total);
}

void gbt_objective_slopes(gbt_workspace *work)
{
    gbt_real slope[GBT_PIECE];
    gbt_value_sums(work);
    for (int i = 0; i <= work->pieces; i++)
        for (int a = 0; a < GBT_PIECE; a++) work->gradient[i][a] = 0;
    for (int i = 0; i < work->pieces; i++) {
        gbt_objective.gradient(seen_by_objective(work->piece, i), work->parameters + i * GBT_END_NUMBERS, work->worth,
                               slope);
        gbt_real *gradient = seen_by_objective(work->gradient, i);
        for (int a = 0; a < GBT_PIECE; a++) gradient[a] = -slope[a];
    }
}

void gbt_differentiate_motion(gbt_workspace *work)
{
    gbt_objective_slopes(work);
    for (int i = 0; i < work->pieces; i++) {
#if GBT_STEPS > 1
        gbt_passed_slopes(work->piece[i], work->passed[i], work->along[i]);
        gbt_end_slopes(work->along[i][GBT_STEPS], work->slopes[i]);
#else
        gbt_stage_slopes(work->piece[i], 0, 0, &work->slopes[i][0][0]);
#endif
    }
}

void gbt_differentiate(gbt_workspace *work)
{
    gbt_real *jacobian = work->jacobian, (*place)[GBT_PLACE] = work->place;
    gbt_differentiate_motion(work);
    for (int i = 0; i < work->pieces; i++) {
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++, place++) {
                limit->jacobian(*place, 0, 0, jacobian);
#if GBT_STEPS > 1
                if (limit->moved)
                    for (int r = 0; r < limit->rows; r++)
                        gbt_chained(work->along[i][gbt_step_of(limit, k)], jacobian + r * GBT_PIECE);
#endif
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

void gbt_pull_back(const gbt_workspace *work, const gbt_real *sides, gbt_piece out[])
{
    gbt_real row[GBT_ROWS], slope[GBT_PIECE];
    const gbt_real *jacobian = work->jacobian;
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                for (int r = 0; r < limit->rows; r++) row[r] = 0;
                for (int r = 0; r < limit->sides; r++) row[limit->row[r]] += limit->sign[r] * sides[r];
                limit->pull(jacobian, row, 0, slope);
                for (int a = 0; a < GBT_PIECE; a++) out[i][a] += slope[a];
                sides += limit->sides;
                jacobian += limit->jacobian_entries;
            }
        }
}

void gbt_push_forward(gbt_workspace *work)
{
    gbt_real row[GBT_ROWS];
    gbt_real *dy = work->step_of.dy;
    const gbt_real *jacobian = work->jacobian;
    for (int i = 0; i < work->pieces; i++)
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++) {
                limit->push(jacobian, work->step[i], 0, row);
                for (int r = 0; r < limit->sides; r++) *dy++ = limit->sign[r] * row[limit->row[r]];
                jacobian += limit->jacobian_entries;
            }
        }
}

/* Adds entries of a lower triangle to that of a matrix. */
static void add(const gbt_real *entry, int entries, const gbt_index *rows, const gbt_index *columns,
                gbt_real matrix[GBT_PIECE][GBT_PIECE])
{
    for (int a = 0; a < entries; a++) matrix[rows[a]][columns[a]] += entry[a];
}

/* The curvature of the objective alone, lower triangles. */
static void bend_objective(gbt_workspace *work)
{
    gbt_real entry[GBT_ENTRIES], weight[GBT_TERMS];
    for (int k = 0; k < GBT_TERMS; k++) weight[k] = -work->worth[k];
    for (int i = 0; i <= work->pieces; i++)
        for (int a = 0; a < GBT_PIECE; a++)
            for (int c = 0; c <= a; c++) work->curvature[i][a][c] = 0;
    for (int i = 0; i < work->pieces; i++) {
        gbt_objective.hessian(seen_by_objective(work->piece, i), work->parameters + i * GBT_END_NUMBERS, weight, entry);
        add(entry, gbt_objective.hessian_entries, gbt_objective.hessian_row, gbt_objective.hessian_column,
            work->curvature[i + GBT_COST_AT_END]);
    }
}

void gbt_bend_motion(gbt_workspace *work)
{
    bend_objective(work);
    for (int i = 0; i < work->pieces; i++)
#if GBT_STEPS > 1
        gbt_add_along_steps(work, i, 0, 0, 0);
#else
        gbt_stage_curvature(work->piece[i], work->pull[i + 1], 0, work->bend[i]);
#endif
}

/* Only the lower triangles. */
void gbt_assemble(gbt_workspace *work)
{
    gbt_real entry[GBT_ENTRIES], weights[2 * GBT_ROWS], (*place)[GBT_PLACE] = work->place;
    const gbt_real *lambda = work->lambda, *sigma = work->sigma, *jacobian = work->jacobian;

    bend_objective(work);
    for (int i = 0; i < work->pieces; i++) {
#if GBT_STEPS > 1
        gbt_add_along_steps(work, i, place, lambda, sigma);
#else
        gbt_stage_curvature(work->piece[i], work->pull[i + 1], 0, work->bend[i]);
#endif
        for (int q = 0; q < GBT_LIMITS; q++) {
            const gbt_limit *limit = &gbt_limits[q];
            for (int k = 0; k < limit->nodes; k++, place++) {
                if (!limit->moved) {
                    gbt_side_weights(limit, lambda, sigma, weights);
                    limit->curvature(*place, weights, jacobian, entry);
                    add(entry, limit->curvature_entries, limit->curvature_row, limit->curvature_column,
                        work->curvature[i]);
                }
                lambda += limit->sides;
                sigma += limit->sides;
                jacobian += limit->jacobian_entries;
            }
        }
    }
}

#if GBT_SUMS
void gbt_end_point(gbt_workspace *work, int i, gbt_real *point)
{
    for (int a = 0; a < GBT_PIECE; a++) point[a] = work->piece[i + GBT_COST_AT_END][a];
}
#endif
