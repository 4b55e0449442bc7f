#include "gbt_gp_root.h"

#if GBT_ROOTED

#include "gbt_math.h"

#define D GBT_DIMENSION
#define R GBT_ROWS_OF_WINDOW
#define TAIL ((gbt_real)1e-30)     /* share of the variance in a window that is left to further functions */
#define ROUNDING ((gbt_real)1e-13) /* share of the variance that counts as rounding of a sum of squares near 1 */
#define SPREAD ((gbt_real)4)       /* of the logarithm of the nugget, of which the prior has its median at the least one */

/* Variances of a measurement relative to the amplitude squared that only a root tells apart. */
static const gbt_real nuggets[] = {1e-22, 1e-20, 1e-18, 1e-16};
enum { NUGGETS = sizeof nuggets / sizeof nuggets[0] };

/* How many functions tell a window of so many rows that reaches so many length scales from its middle; 0 if too many. */
static int functions_for(gbt_real reach, int rows)
{
    gbt_real left = 1;
    for (int n = 1; n <= GBT_FUNCTIONS; n++) {
        left *= reach * reach / (gbt_real)n;
        if (left <= TAIL && n * D >= rows) return n;
    }
    return 0;
}

static void functions_at(gbt_real x, int count, gbt_real *value)
{
    value[0] = gbt_exp(x * x / -2);
    for (int n = 1; n < count; n++) value[n] = value[n - 1] * (x / gbt_sqrt((gbt_real)n));
}

/* In four sums, for an addition need not wait for the one before it. */
static gbt_real product(const gbt_real *a, const gbt_real *b, int n)
{
    gbt_real sum[4] = {0, 0, 0, 0};
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        sum[0] += a[i] * b[i];
        sum[1] += a[i + 1] * b[i + 1];
        sum[2] += a[i + 2] * b[i + 2];
        sum[3] += a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) sum[0] += a[i] * b[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Reflects coefficients by reflection number j of the process, which leaves what is before entry j. */
static void reflect(const gbt_gp_root *root, int j, gbt_real *vector)
{
    const gbt_real *normal = root->process[j];
    const int n = D * root->functions;
    const gbt_real along = root->of_process[j].factor * product(normal + j, vector + j, n - j);
    for (int i = j; i < n; i++) vector[i] -= along * normal[i];
}

/* The same of the noise: of an entry of the triangle, and of the noise of the rows up to j. */
static void reflect_noise(const gbt_gp_root *root, int j, gbt_real *entry, gbt_real *noise)
{
    const gbt_real *normal = root->noise[j];
    const gbt_real along = root->of_noise[j].factor * (root->top[j] * *entry + product(normal, noise, j + 1));
    *entry -= along * root->top[j];
    for (int i = 0; i <= j; i++) noise[i] -= along * normal[i];
}

/* The reflection of a column that begins with first and has so long a rest; returns the first entry of its normal. */
static gbt_real reflection_of(gbt_real first, gbt_real square, gbt_reflection *reflection)
{
    reflection->pivot = first > 0 ? -gbt_sqrt(square) : gbt_sqrt(square);
    first -= reflection->pivot;
    /* twice the pivot times what it has moved is the square of the normal; a column of zeros is left as it is */
    reflection->factor = reflection->pivot != 0 ? -1 / (reflection->pivot * first) : 0;
    return first;
}

/* What the rows say of the coefficients, to a triangle. */
static void decompose(gbt_gp_root *root)
{
    const int n = D * root->functions;
    for (int j = 0; j < root->rows; j++) {
        gbt_real *normal = root->process[j];
        const gbt_real square = product(normal + j, normal + j, n - j);
        normal[j] = reflection_of(normal[j], square, &root->of_process[j]);
        for (int k = j + 1; k < root->rows; k++) reflect(root, j, root->process[k]);
    }
}

/* That triangle and the noise to another one, under a nugget, with L^-1 times the values; returns the likelihood of the
   nugget times its prior, but for a constant. */
static gbt_real add_noise(gbt_gp_root *root, const gbt_gp_rows *rows, gbt_real nugget, gbt_real whitened[R])
{
    const gbt_real off = (gbt_log(nugget) - gbt_log(nuggets[0])) / SPREAD;
    gbt_real likelihood = off * off / -2;
    for (int r = 0; r < root->rows; r++) {
        for (int i = 0; i < r; i++) root->upper[r][i] = root->process[r][i];
        root->upper[r][r] = root->of_process[r].pivot;
        for (int i = 0; i < root->rows; i++) root->noise[r][i] = 0;
        root->noise[r][r] = gbt_sqrt(root->amplitude * root->amplitude * nugget + rows->variance[r]);
    }
    for (int j = 0; j < root->rows; j++) {
        const gbt_real first = root->upper[j][j], square = first * first + product(root->noise[j], root->noise[j], j + 1);
        gbt_real rest = rows->value[j];
        root->top[j] = reflection_of(first, square, &root->of_noise[j]);
        for (int k = j + 1; k < root->rows; k++) reflect_noise(root, j, &root->upper[k][j], root->noise[k]);
        for (int k = 0; k < j; k++) rest -= root->upper[j][k] * whitened[k];
        whitened[j] = rest / root->of_noise[j].pivot;
        likelihood -= whitened[j] * whitened[j] / 2 + gbt_log(gbt_fabs(root->of_noise[j].pivot));
    }
    return likelihood;
}

/* The nugget under which the measurements are likeliest, of those that a covariance cannot tell from its rounding. */
static gbt_real likeliest(gbt_gp_root *root, const gbt_gp_rows *rows, gbt_real nugget, gbt_real rounding)
{
    gbt_real whitened[R], best = nuggets[0], most = -GBT_INFINITY;
    if (!(nugget <= 10 * rounding)) return nugget;
    for (int k = 0; k <= NUGGETS; k++) {
        const gbt_real tried = k < NUGGETS ? nuggets[k] : nugget, likelihood = add_noise(root, rows, tried, whitened);
        if (!(likelihood > most)) continue;
        most = likelihood;
        best = tried;
    }
    return best;
}

int gbt_gp_root_condition(gbt_gp_root *root, const gbt_gp_rows *rows, const gbt_real *log_theta, gbt_real rounding)
{
    gbt_real first = 0, last = 0, value[GBT_FUNCTIONS], whitened[R], noise[R];
    if (rows->rows == 0) return 0;
    for (int r = 0; r < rows->rows; r++) {
        const gbt_real time = gbt_narrow(rows->time[r]);
        if (r == 0 || time < first) first = time;
        if (r == 0 || time > last) last = time;
    }
    root->scale = gbt_exp(log_theta[0]);
    root->amplitude = gbt_exp(log_theta[GBT_SHAPES]);
    root->middle = (first + last) / 2;
    root->rows = rows->rows;
    root->functions = functions_for((last - first) / 2 / root->scale, rows->rows);
    if (root->functions == 0) return 0;
    for (int r = 0; r < rows->rows; r++) {
        functions_at((gbt_narrow(rows->time[r]) - root->middle) / root->scale, root->functions, value);
        for (int a = 0; a < D; a++)
            for (int n = 0; n < root->functions; n++)
                root->process[r][a * root->functions + n] = root->amplitude * rows->direction[r][a] * value[n];
    }
    decompose(root);
    add_noise(root, rows, likeliest(root, rows, gbt_exp(log_theta[GBT_TUNABLE - 1]), rounding), whitened);

    for (int i = 0; i < D * root->functions; i++) root->found[i] = i < root->rows ? whitened[i] : 0;
    for (int i = 0; i < root->rows; i++) noise[i] = 0;
    for (int j = root->rows - 1; j >= 0; j--) reflect_noise(root, j, &root->found[j], noise);
    for (int j = root->rows - 1; j >= 0; j--) reflect(root, j, root->found);
    return 1;
}

void gbt_gp_root_predict(const gbt_gp_root *root, gbt_real time, gbt_real *mean, gbt_real *covariance)
{
    const int count = root->functions, n = D * count;
    gbt_real value[GBT_FUNCTIONS], left[D][GBT_COEFFICIENTS], noise[D][R], tail = 1 - ROUNDING;
    functions_at((time - root->middle) / root->scale, count, value);
    for (int k = 0; k < count; k++) tail -= value[k] * value[k];
    for (int a = 0; a < D; a++) {
        mean[a] = 0;
        for (int i = 0; i < n; i++) left[a][i] = 0;
        for (int i = 0; i < root->rows; i++) noise[a][i] = 0;
        for (int k = 0; k < count; k++) {
            left[a][a * count + k] = root->amplitude * value[k];
            mean[a] += root->amplitude * value[k] * root->found[a * count + k];
        }
        for (int j = 0; j < root->rows; j++) reflect(root, j, left[a]);
        for (int j = 0; j < root->rows; j++) reflect_noise(root, j, &left[a][j], noise[a]);
        for (int b = 0; b <= a; b++) {
            gbt_real sum = a == b ? root->amplitude * root->amplitude * gbt_fmax(tail, 0) : 0;
            sum += product(left[a] + root->rows, left[b] + root->rows, n - root->rows);
            sum += product(noise[a], noise[b], root->rows);
            covariance[a * D + b] = covariance[b * D + a] = sum;
        }
    }
}

#endif
