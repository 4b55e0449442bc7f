#include "gbt_shape_rows.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_COORDINATES
#define NEAREST ((gbt_real)1e-2)     /* range below which a bearing's slope grows no further, m */
#define RECENT 8                     /* bins over which the reset test looks */

/* ---- what is seen ---- */

/* Sorts a place in; places behind the oldest node are held there. */
static void add_spot(const gbt_shape_prior *prior, gbt_seen *seen, double time, gbt_what what, int number)
{
    const double node = fmin(fmax(-time * GBT_KNOT_NODES / prior->knot, 0), GBT_NODES_PAST - 1);
    const int left = node < GBT_NODES_PAST - 1 ? (int)node : GBT_NODES_PAST - 2;
    const gbt_real share = (gbt_real)(node - left);
    int k = seen->spots++;
    for (; k > 0 && (seen->spot[k - 1].left > left || (seen->spot[k - 1].left == left && seen->spot[k - 1].share > share));
         k--)
        seen->spot[k] = seen->spot[k - 1];
    seen->spot[k].left = left;
    seen->spot[k].share = share;
    seen->spot[k].what = what;
    seen->spot[k].number = number;
}

/* Deviation of an angle, or of the logarithm of a length. */
static gbt_real deviation_of(const gbt_sighting *one)
{
    if (one->kind == GBT_RANGE) return one->std[0] / one->value[0];
    return one->kind == GBT_SIZE ? one->std[0] / gbt_sin(one->value[0]) : one->std[0];
}

void gbt_see(const gbt_shape_prior *prior, const gbt_shape_noise *noise, const gbt_bins *bins, gbt_real white,
             const gbt_singles *singles, const gbt_known *known, double now, const gbt_real *own, gbt_seen *seen)
{
    seen->bins = bins->count;
    seen->white = white;
    seen->spots = seen->others = 0;
    seen->known = known ? known->count : 0;
    seen->shared_square = seen->others_log_determinant = 0;
    for (int k = bins->count - 1; k >= 0; k--) {
        const gbt_bin *bin = &bins->bin[k];
        seen->time[k] = (gbt_real)(bin->time - now);
        seen->count[k] = bin->count;
        for (int j = 0; j < D; j++) {
            seen->bearing[k][j] = bin->bearing[j];
            seen->own[k][j] = bin->own[j] - own[j];
        }
        add_spot(prior, seen, bin->time - now, GBT_SEES_BEARING, k);
    }
    for (int k = 0; k < singles->count; k++) {
        const gbt_sighting *one = &singles->single[k].sighting;
        const int m = seen->others;
        if (!(one->time <= now)) continue;
        seen->others++;
        seen->other[m] = *one;
        for (int j = 0; j < D; j++) seen->other[m].position[j] -= own[j];
        seen->deviation[m] = deviation_of(one);
        seen->shared[m] = one->kind == GBT_SIZE ? noise->log_size_std / seen->deviation[m] : 0;
        seen->shared_square += seen->shared[m] * seen->shared[m];
        seen->others_log_determinant += 2 * gbt_log(seen->deviation[m]);
        add_spot(prior, seen, one->time - now, GBT_SEES_OTHER, m);
    }
    seen->others_log_determinant += gbt_log1p(seen->shared_square);
    for (int k = 0; k < seen->known; k++) {
        for (int j = 0; j < D; j++) seen->position[k][j] = known->position[k][j] - own[j];
        add_spot(prior, seen, known->time[k] - now, GBT_SEES_KNOWN, k);
    }
    for (int k = 0; k < GBT_ROW_BEGIN(seen->known * D); k++) seen->root[k] = known->root[k];
}

/* ---- rows ---- */

/* Adds a row to the normal equations, of which so many slopes are not zero. */
static void add_row(gbt_normal *normal, const gbt_real *slopes, int active, gbt_real residual, gbt_real sign)
{
    for (int i = 0; i < active; i++) {
        const gbt_real one = sign * slopes[i];
        gbt_real *row = &normal->precision[GBT_ROW_BEGIN(i)];
        for (int j = 0; j <= i; j++) row[j] += one * slopes[j];
        normal->gradient[i] += one * residual;
    }
}

/* Where the error is expected at a time, and how well that is known. */
static void lasting_at(gbt_lasting *error, const gbt_shape_noise *noise, gbt_real time)
{
    const gbt_real all = noise->correlated_std * noise->correlated_std;
    const gbt_real kept =
        error->begun ? gbt_exp(-gbt_fabs(time - error->time) / (gbt_real)noise->correlation_time) : 0;
    for (int a = 0; a < GBT_AXES; a++) {
        error->residual[a] = error->begun ? kept * error->residual[a] : 0;
        for (int j = 0; j < N; j++) error->slopes[a][j] = error->begun ? kept * error->slopes[a][j] : 0;
    }
    error->variance = error->begun ? kept * kept * error->variance + (1 - kept * kept) * all : all;
    error->time = time;
    error->begun = 1;
}

/* Variance of a mean bearing without the error that lasts. */
static gbt_real variance_of(const gbt_shape_noise *noise, const gbt_seen *seen, const gbt_real *range, int k)
{
#if GBT_OWN_NOISE
    const gbt_real off = noise->own_std / gbt_fmax(range[k], NEAREST);
    return (seen->white + off * off) / seen->count[k];
#else
    (void)noise;
    (void)range;
    return seen->white / seen->count[k];
#endif
}

/* Slopes of a projection of the position between two nodes. */
static void project(const gbt_walk *on, const gbt_real *direction, gbt_real share, gbt_real *slopes)
{
    for (int j = 0; j < on->slopes.active; j++) slopes[j] = 0;
    for (int i = 0; i < D; i++) {
        const gbt_real first = (1 - share) * direction[i], last = share * direction[i];
        for (int j = 0; j < on->slopes.active; j++)
            slopes[j] += first * on->slopes.before[i][j] + last * on->slopes.here[i][j];
    }
}

static void see_bearing(gbt_walk *on, int k, const gbt_real *position, gbt_real share)
{
    const gbt_seen *seen = on->seen;
    gbt_real unit[D], basis[GBT_AXES][D], slopes[N], *angle = on->angle[k];
    const gbt_real variance = variance_of(on->noise, seen, on->range, k);
    const int lasts = on->noise->correlated_std > 0;
    for (int i = 0; i < D; i++) unit[i] = position[i] - seen->own[k][i];
    const gbt_real range = gbt_fmax(gbt_length(unit), NEAREST);
    for (int i = 0; i < D; i++) unit[i] /= range;
    gbt_tangent_basis(unit, basis);
    gbt_log_map(unit, seen->bearing[k], basis, angle);
    if (lasts) lasting_at(&on->error, on->noise, seen->time[k]);
    const gbt_real spread = variance + (lasts ? on->error.variance : 0), gain = lasts ? on->error.variance / spread : 0;
    for (int a = 0; a < GBT_AXES; a++) {
        const gbt_real left = angle[a] - (lasts ? on->error.residual[a] : 0), root = gbt_sqrt(spread);
        on->objective += left * left / spread;
        if (lasts) on->error.residual[a] += gain * left;
        if (!on->normal) continue;
        for (int i = 0; i < D; i++) basis[a][i] /= range;
        project(on, basis[a], share, slopes);
        for (int j = 0; lasts && j < on->slopes.active; j++) {
            slopes[j] -= on->error.slopes[a][j];
            on->error.slopes[a][j] += gain * slopes[j];
        }
        for (int j = 0; j < on->slopes.active; j++) slopes[j] /= root;
        add_row(on->normal, slopes, on->slopes.active, left / root, 1);
    }
    if (lasts) on->error.variance *= 1 - gain;
    on->log_determinant += gbt_log(spread);
}

static void see_other(gbt_walk *on, int k, const gbt_real *position, gbt_real share)
{
    const gbt_seen *seen = on->seen;
    gbt_polar_rows rows;
    gbt_real toward[D], slopes[N];
    gbt_polar_of(&seen->other[k], position, 1, on->noise->log_size, &rows);
    const gbt_real residual = rows.residuals[0] / rows.std[0];
    on->objective += residual * residual;
    on->shared += seen->shared[k] * residual;
    if (!on->normal) return;
    for (int i = 0; i < D; i++)
        toward[i] = (rows.across[0][i] + rows.along[0] * rows.unit[i]) / (rows.range * rows.std[0]);
    project(on, toward, share, slopes);
    for (int j = 0; j < on->slopes.active; j++) on->shared_slopes[j] += seen->shared[k] * slopes[j];
    add_row(on->normal, slopes, on->slopes.active, residual, 1);
}

static void see_known(gbt_walk *on, int k, const gbt_real *position, gbt_real share)
{
    for (int i = 0; i < D; i++) {
        on->known[k * D + i] = on->seen->position[k][i] - position[i];
        if (!on->normal) continue;
        for (int j = 0; j < N; j++)
            on->known_slopes[k * D + i][j] =
                j < on->slopes.active ? (1 - share) * on->slopes.before[i][j] + share * on->slopes.here[i][j] : 0;
    }
}

/* The known positions together, and what the true size has changed in all angular sizes. */
static void see_all(gbt_walk *on)
{
    const gbt_seen *seen = on->seen;
    gbt_real slopes[N];
    for (int r = 0; r < seen->known * D; r++) {
        const gbt_real *root = &seen->root[GBT_ROW_BEGIN(r)];
        gbt_real residual = 0;
        for (int j = 0; j < N; j++) slopes[j] = 0;
        for (int q = 0; q <= r; q++) {
            residual += root[q] * on->known[q];
            for (int j = 0; on->normal && j < N; j++) slopes[j] += root[q] * on->known_slopes[q][j];
        }
        on->objective += residual * residual;
        if (on->normal) add_row(on->normal, slopes, N, residual, 1);
    }
    if (!(seen->shared_square > 0)) return;
    const gbt_real all = 1 + seen->shared_square;
    on->objective -= on->shared * on->shared / all;
    if (!on->normal) return;
    for (int j = 0; j < N; j++) on->shared_slopes[j] /= gbt_sqrt(all);
    add_row(on->normal, on->shared_slopes, N, on->shared / gbt_sqrt(all), -1);
}

/* Walks along a motion: the objective, and where asked for the normal equations. */
void gbt_walk_along(gbt_walk *on, const gbt_shape_prior *prior, const gbt_motion *motion)
{
    const gbt_seen *seen = on->seen;
    gbt_course course;
    gbt_real before[D], position[D];
    on->error.begun = 0;
    on->objective = on->log_determinant = on->shared = 0;
    for (int j = 0; j < N; j++) {
        on->shared_slopes[j] = 0;
        on->objective += motion->white[j] * motion->white[j];
    }
    if (on->normal) {
        for (int j = 0; j < GBT_ROW_BEGIN(N); j++) on->normal->precision[j] = 0;
        for (int j = 0; j < N; j++) {
            on->normal->precision[GBT_ROW_BEGIN(j) + j] = 1;
            on->normal->gradient[j] = -motion->white[j];
        }
    }
    gbt_course_begin(&course, on->normal ? &on->slopes : 0, prior, motion, 0);
    for (int k = 0; k < seen->spots;) {
        for (int i = 0; i < D; i++) before[i] = course.position[i];
        gbt_course_next(&course, on->normal ? &on->slopes : 0, prior, motion);
        for (; k < seen->spots && seen->spot[k].left < course.node; k++) {
            const gbt_spot *spot = &seen->spot[k];
            for (int i = 0; i < D; i++)
                position[i] = (1 - spot->share) * before[i] + spot->share * course.position[i];
            if (spot->what == GBT_SEES_BEARING) see_bearing(on, spot->number, position, spot->share);
            if (spot->what == GBT_SEES_OTHER) see_other(on, spot->number, position, spot->share);
            if (spot->what == GBT_SEES_KNOWN) see_known(on, spot->number, position, spot->share);
        }
    }
    see_all(on);
}

/* Mean squared standardised residual of the latest bins, the oldest first as a filter takes them. */
gbt_real gbt_recent_residual(const gbt_walk *on)
{
    const gbt_seen *seen = on->seen;
    const gbt_real all = on->noise->correlated_std * on->noise->correlated_std;
    const gbt_real forgets = (gbt_real)on->noise->correlation_time;
    gbt_real sum = 0, variance = all, mean[GBT_AXES] = {0};
    int count = 0;
    const int first = all > 0 || seen->bins < RECENT ? 0 : seen->bins - RECENT;
    for (int k = first; k < seen->bins; k++) {
        const gbt_real spread = variance_of(on->noise, seen, on->range, k) + variance, gain = variance / spread;
        const gbt_real passed = k + 1 < seen->bins ? seen->time[k + 1] - seen->time[k] : 0;
        const gbt_real kept = all > 0 ? gbt_exp(-passed / forgets) : 0;
        for (int a = 0; a < GBT_AXES; a++) {
            const gbt_real left = on->angle[k][a] - mean[a];
            if (k >= seen->bins - RECENT) sum += left * left / spread;
            if (k >= seen->bins - RECENT) count++;
            mean[a] = kept * (mean[a] + gain * left);
        }
        variance = kept * kept * (1 - gain) * variance + (1 - kept * kept) * all;
    }
    return sum / (gbt_real)count;
}
