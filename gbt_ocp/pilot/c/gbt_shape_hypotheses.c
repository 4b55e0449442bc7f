#include "gbt_shape_hypotheses.h"

#include "gbt_math.h"
#include "gbt_mixed.h"

#define D GBT_DIMENSION
#define N GBT_COORDINATES
#define T GBT_POINTS
#define COLD_ITERATIONS 8                      /* steps of a start that rests on no earlier estimate */
#define APART ((gbt_real)1)                    /* distance of two modes, in deviations of log range, of two hypotheses, */
#define TURNED ((gbt_real)0.8)                 /* and difference of their headings, rad */
#define NEGLIGIBLE ((gbt_real)-9.210340371976182) /* log of the share of the evidence below which something is left out */
#define FADES ((gbt_real)20)                   /* time in which bearings count less for a cold start, s */

/* A fitted motion at its mode. */
static void mode_of(const gbt_fitted *fitted, gbt_motion *motion) { gbt_motion_move(&fitted->at, fitted->step, motion); }

static gbt_real heading_of(const gbt_fitted *one)
{
    return one->at.heading + GBT_FLAT_ANGLE * one->step[GBT_HEADING_AT];
}

/* Whether two fitted motions are the same. */
static int same(const gbt_shape_prior *prior, const gbt_fitted *one, const gbt_fitted *other)
{
    const gbt_real log_range = prior->log_range_std * (one->at.white[0] + one->step[0] - other->at.white[0] - other->step[0]);
    const gbt_real deviation = prior->log_range_std * gbt_sqrt(gbt_fmax(one->variance, other->variance));
    const gbt_real turn = heading_of(one) - heading_of(other);
    const gbt_real turned = gbt_fabs(gbt_atan2(gbt_sin(turn), gbt_cos(turn)));
    return gbt_fabs(log_range) / ((gbt_real)0.05 + deviation) < APART && turned < TURNED;
}

/* A straight line through the bearings at a range. */
static void cold_start(const gbt_shape_prior *prior, const gbt_seen *seen, gbt_real range, gbt_motion *motion)
{
    gbt_real weight = 0, time = 0, spread = 0, place[D] = {0}, velocity[D] = {0};
    for (int k = 0; k < seen->bins; k++) {
        const gbt_real one = seen->count[k] * gbt_exp(2 * seen->time[k] / FADES);
        weight += one;
        time += one * seen->time[k];
        for (int j = 0; j < D; j++) place[j] += one * (seen->own[k][j] + range * seen->bearing[k][j]);
    }
    for (int k = 0; seen->bins > 2 && k < seen->bins; k++) {
        const gbt_real since = seen->time[k] - time / weight;
        const gbt_real one = seen->count[k] * gbt_exp(2 * seen->time[k] / FADES) * since;
        spread += one * since;
        for (int j = 0; j < D; j++)
            velocity[j] += one * (seen->own[k][j] + range * seen->bearing[k][j] - place[j] / weight);
    }
    for (int j = 0; j < D; j++) velocity[j] = spread > 0 ? velocity[j] / spread : 0;
    gbt_motion_begin(prior, T / 2, range, seen->bearing[seen->bins - 1], velocity, motion);
}

int gbt_hypotheses_compete(const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, int hypotheses)
{
    gbt_fitted *cold = work->cold, *fitted = work->fitted;
    int order[GBT_STARTS], chosen[GBT_HYPOTHESES], fresh = 0;
    gbt_real standard = -GBT_INFINITY;
    for (int k = 0; k < GBT_STARTS; k++) cold_start(&settings->prior, &work->seen, settings->starts[k], &cold[k].at);
    gbt_shape_fit(&settings->prior, &settings->noise, &work->seen, cold, GBT_STARTS, COLD_ITERATIONS, &work->walk,
                  &work->normal);
    for (int k = 0; k < GBT_STARTS; k++) {
        int place = k;
        for (; place > 0 && cold[order[place - 1]].log_evidence < cold[k].log_evidence; place--)
            order[place] = order[place - 1];
        order[place] = k;
        if (hypotheses == 0) standard = gbt_fmax(standard, cold[k].log_evidence);
    }
    for (int h = 0; h < hypotheses; h++) standard = gbt_fmax(standard, fitted[h * T + T / 2].log_evidence);
    for (int k = 0; k < GBT_STARTS && fresh < GBT_HYPOTHESES; k++) {
        const gbt_fitted *one = &cold[order[k]];
        int known = 0;
        if (!(one->log_evidence >= standard + NEGLIGIBLE / 2)) break;
        for (int h = 0; h < hypotheses; h++) known = known || same(&settings->prior, one, &fitted[h * T + T / 2]);
        for (int f = 0; f < fresh; f++) known = known || same(&settings->prior, one, &cold[chosen[f]]);
        if (!known) chosen[fresh++] = order[k];
    }
    for (int f = 0; f < fresh; f++) {
        gbt_motion mode;
        mode_of(&cold[chosen[f]], &mode);
        for (int t = 0; t < T; t++) {
            gbt_fitted *one = &fitted[(hypotheses + f) * T + t];
            gbt_motion_transfer(&settings->prior, &mode, t, &one->at);
        }
    }
    gbt_shape_fit(&settings->prior, &settings->noise, &work->seen, &fitted[hypotheses * T], fresh * T,
                  settings->iterations, &work->walk, &work->normal);
    return hypotheses + fresh;
}

/* Logarithm of the mean of the exponentials of log evidences. */
static gbt_real log_mean(const gbt_fitted *fitted, int count)
{
    gbt_real largest = -GBT_INFINITY, sum = 0;
    for (int k = 0; k < count; k++) largest = gbt_fmax(largest, fitted[k].log_evidence);
    if (!(largest > -GBT_INFINITY)) return largest;
    for (int k = 0; k < count; k++) sum += gbt_exp(fitted[k].log_evidence - largest);
    return largest + gbt_log(sum / (gbt_real)count);
}

static int best_of(const gbt_fitted *fitted, int count)
{
    int best = 0;
    for (int k = 1; k < count; k++)
        if (fitted[k].log_evidence > fitted[best].log_evidence) best = k;
    return best;
}

int gbt_hypotheses_distinct(const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, int hypotheses)
{
    gbt_fitted *fitted = work->fitted;
    gbt_real total[2 * GBT_HYPOTHESES];
    int order[2 * GBT_HYPOTHESES], keep[2 * GBT_HYPOTHESES], best[GBT_HYPOTHESES], kept = 0, rest = 0;
    for (int h = 0; h < hypotheses; h++) {
        int place = h;
        total[h] = log_mean(&fitted[h * T], T);
        keep[h] = 0;
        for (; place > 0 && total[order[place - 1]] < total[h]; place--) order[place] = order[place - 1];
        order[place] = h;
    }
    for (int k = 0; k < hypotheses && kept < GBT_HYPOTHESES; k++) {
        const int one = order[k], top = one * T + best_of(&fitted[one * T], T);
        int known = 0;
        if (!(total[one] >= total[order[0]] + NEGLIGIBLE)) break;
        for (int b = 0; b < kept; b++) known = known || same(&settings->prior, &fitted[top], &fitted[best[b]]);
        if (known) continue;
        keep[one] = 1;
        best[kept++] = top;
    }
    for (int h = 0; h < hypotheses; h++) {
        if (!keep[h]) continue;
        for (int t = 0; rest != h && t < T; t++) fitted[rest * T + t] = fitted[h * T + t];
        rest++;
    }
    return rest;
}

/* ---- moments ---- */

/* Covariance of positions by the factor of the precision and their slopes, of which those of the past replace. */
static void spread_of(const gbt_normal *normal, gbt_real *slopes[], int rows, gbt_real *spread)
{
    for (int i = 0; i < rows; i++) {
        gbt_solve_lower(normal->precision, N, slopes[i]);
        for (int j = 0; j <= i; j++) {
            gbt_real sum = 0;
            for (int k = 0; k < N; k++) sum += slopes[i][k] * slopes[j][k];
            spread[i * rows + j] = spread[j * rows + i] = sum;
        }
    }
}

/* Adds a motion to the moments of its hypothesis and to those of now. */
static void add_moments(const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, const gbt_fitted *fitted,
                        gbt_real weight, gbt_real before, gbt_hypothesis *hypothesis, gbt_motion_gp *process,
                        gbt_real before_all)
{
    gbt_motion mode;
    gbt_course course;
    gbt_slopes *slopes = &work->walk.slopes; /* free again once the walk has left its factor */
    gbt_real rows[2 * D][N + GBT_BEYOND], both[2 * D], joint[2 * D * 2 * D], spread[D * D], *row[2 * D];
    for (int i = 0; i < 2 * D; i++) row[i] = rows[i];
    gbt_shape_factor(&settings->prior, &settings->noise, &work->seen, fitted, &work->walk, &work->normal);
    mode_of(fitted, &mode);
    gbt_course_begin(&course, slopes, &settings->prior, &mode, 0);
    for (int k = 0; k < 2; k++) {
        if (k > 0) gbt_course_next(&course, slopes, &settings->prior, &mode);
        for (int i = 0; i < D; i++) {
            both[k * D + i] = course.position[i];
            for (int j = 0; j < N; j++) rows[k * D + i][j] = j < slopes->active ? slopes->here[i][j] : 0;
        }
    }
    spread_of(&work->normal, row, 2 * D, joint);
    gbt_mix(process->position[0], process->covariance[0], 2 * D, before_all, weight, both, joint);
    gbt_course_begin(&course, slopes, &settings->prior, &mode, 1);
    for (int node = 0; node < GBT_NODES_AHEAD; node++) {
        if (node > 0) gbt_course_next(&course, slopes, &settings->prior, &mode);
        for (int i = 0; i < D; i++)
            for (int j = 0; j < N + GBT_BEYOND; j++) rows[i][j] = slopes->here[i][j];
        spread_of(&work->normal, row, D, spread);
        for (int i = 0; i < D; i++)
            for (int j = 0; j < D; j++)
                for (int k = N; k < N + GBT_BEYOND; k++) spread[i * D + j] += rows[i][k] * rows[j][k];
        gbt_mix(hypothesis->mean[node], hypothesis->covariance[node][0], D, before, weight, course.position, spread);
    }
}

/* Median range now of a hypothesis, and the deviation of its logarithm. */
static void summarise(const gbt_shape_prior *prior, const gbt_fitted *fitted, const gbt_real *weight,
                      gbt_hypothesis *hypothesis)
{
    gbt_real total = 0, mean = 0, square = 0;
    const gbt_real share = prior->log_range_std * prior->log_range_std;
    for (int t = 0; t < T; t++) total += weight[t];
    total = gbt_fmax(total, (gbt_real)1e-30);
    for (int t = 0; t < T; t++)
        mean += weight[t] / total * (gbt_log(prior->range) + prior->log_range_std * (fitted[t].at.white[0] + fitted[t].step[0]));
    for (int t = 0; t < T; t++) {
        const gbt_real off = gbt_log(prior->range) + prior->log_range_std * (fitted[t].at.white[0] + fitted[t].step[0]) - mean;
        square += weight[t] / total * (share * fitted[t].variance + off * off);
    }
    hypothesis->share = total;
    hypothesis->log_range = mean;
    hypothesis->log_range_std = gbt_sqrt(square);
}

void gbt_hypotheses_moments(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work)
{
    const int count = process->hypotheses * T;
    gbt_real weight[GBT_MOTIONS], total = 0, before = 0;
    const gbt_real largest = work->fitted[best_of(work->fitted, count)].log_evidence;
    for (int k = 0; k < count; k++) total += weight[k] = gbt_exp(work->fitted[k].log_evidence - largest);
    for (int k = 0; k < count; k++) weight[k] /= total;
    process->log_evidence = log_mean(work->fitted, count) + gbt_log((gbt_real)process->hypotheses);
    process->likely = 0;
    for (int i = 0; i < 2 * D; i++) {
        process->position[i / D][i % D] = 0;
        for (int j = 0; j < 2 * D; j++) process->covariance[i][j] = 0;
    }
    total = 0;
    for (int k = 0; k < count; k++) total += weight[k] > gbt_exp(NEGLIGIBLE) ? weight[k] : 0;
    /* those that count stand first */
    for (int counts = 1; counts >= 0; counts--)
        for (int h = 0, place = counts ? 0 : process->likely; h < process->hypotheses; h++) {
            gbt_real mine = 0;
            for (int t = 0; t < T; t++) mine += weight[h * T + t] > gbt_exp(NEGLIGIBLE) ? weight[h * T + t] : 0;
            if ((mine > 0) != counts) continue;
            gbt_hypothesis *one = &process->hypothesis[place++];
            *one = (gbt_hypothesis){0};
            summarise(&settings->prior, &work->fitted[h * T], &weight[h * T], one);
            if (!counts) continue;
            process->likely++;
            one->weight = mine / total;
            mine = 0;
            for (int t = 0; t < T; t++) {
                const gbt_real share = weight[h * T + t];
                if (!(share > gbt_exp(NEGLIGIBLE))) continue;
                add_moments(settings, work, &work->fitted[h * T + t], share, mine, one, process, before);
                mine += share;
                before += share;
            }
        }
}
