/* One control step of the cell; equations are those of the paper (Nadizar et al., 2022).
 *
 * Sums are in the order of the offline cell, and the compiler must not fuse products and sums
 * (-ffp-contract=off), so that each result has the bits of the offline cell.
 */
#include "cell.h"

static const uint16_t sizes[] = LAYER_SIZES; /* neurons per layer, from input to output */
enum { N_LAYERS = sizeof sizes / sizeof *sizes, OUTPUT = N_NEURONS - 1 - N_SENT };

static word words[N_NEURONS];                /* what each neuron sends in this control step */

#if SPIKING

enum { WINDOW = 5 };
static const number CONTROL_RATE = 60, SNN_RATE = 960, F_MIN = 5, F_MAX = 50;

static uint32_t age;                   /* control steps since the reset */
static uint32_t last_spike[N_SENSORS]; /* SNN step of the newest spike of each reading */
static uint8_t counts[WINDOW];         /* actuation spikes of the last control steps */
static number v[N_NEURONS], psi[N_NEURONS], theta[AS_PRINTED ? N_NEURONS : 1];

/* A reading r spikes on the first step of all, then every floor(f_h / f) SNN steps, where
 * f = r (f_max - f_min) + f_min (Eq. 4). */
static word encode(unsigned s, reading r, uint32_t first)
{
#if INTEGER
    uint32_t period = (uint32_t)(SNN_RATE * 65535 / (r * (F_MAX - F_MIN) + F_MIN * 65535));
#else
    uint32_t period = (uint32_t)(SNN_RATE / (r * (F_MAX - F_MIN) + F_MIN));
#endif
    uint32_t elapsed = first - last_spike[s], train = 0;
    uint32_t h = age == 0 ? 0 : (elapsed + period - 1) / period * period - elapsed;
    for (; h < SNN_STEPS; h += period) {
        train |= 1U << h;
        last_spike[s] = first + h;
    }
    return (word)train;
}

/* a = 2 n / (f_max T) - 1 for n spikes in a window of duration T, clipped (Eq. 5). */
static actuation decode(unsigned train)
{
    uint32_t n = 0, window = age < WINDOW ? age + 1 : WINDOW;
    for (counts[age % WINDOW] = 0; train; train &= train - 1)
        counts[age % WINDOW]++;
    age++;
    for (uint32_t k = 0; k < window; k++)
        n += counts[k];
#if INTEGER
    number a = 2 * CONTROL_RATE * 16384 * (number)n / (F_MAX * (number)window) - 16384;
    return (actuation)(a > 16384 ? 16384 : a);
#else
    number duration = (number)window / CONTROL_RATE, share = (number)n / (F_MAX * duration);
    number a = 2 * share - 1;
    return a > 1 ? 1 : a;
#endif
}

/* What leaks of a potential or an offset in an SNN step: lambda dt x, usually x / 96. */
static number leak(number x)
{
#if INTEGER
    x += x >> 2; /* x / 96 = (4/3) x / 128, and 4/3 is nearly (1 + 1/4) (1 + 1/16) (1 + 1/256) */
    x += x >> 4;
    x += x >> 8;
    return (x + 64) >> 7;
#else
    return LEAK * x;
#endif
}

/* Run all SNN steps of neuron j of layer l; return its train. It has n synapses. */
static word run_neuron(unsigned j, unsigned l, const weight *w, const word *pre, unsigned n)
{
    number currents[SNN_STEPS]; /* sum of w_i s_i, in presynaptic order */
    unsigned train = 0;
    (void)l; /* which only the scale of integers depends on */
    for (unsigned h = 0; h < SNN_STEPS; h++)
        currents[h] = 0;
    for (unsigned i = 0; i < n; i++) {
        number weight_in_mv = IN_MV(w[i], l);
        for (unsigned h = 0, spikes = pre[i]; spikes; h++, spikes >>= 1)
            if (spikes & 1)
                currents[h] += weight_in_mv;
    }
    for (unsigned h = 0; h < SNN_STEPS; h++) {
        v[j] += currents[h]; /* v <- v + sum of w_i s_i (Eq. 1) */
#if INTEGER
        v[j] = v[j] < LOWEST ? LOWEST : v[j];
#endif
#if AS_PRINTED
        theta[j] = (theta[j] < constants[j] ? theta[j] : constants[j]) + psi[j]; /* Eq. 2 */
        unsigned spike = v[j] > theta[j];
#else
        unsigned spike = v[j] >= constants[j] + psi[j]; /* theta = min(theta_0, bound) + psi */
#endif
        psi[j] += spike ? PSI_INC : -leak(psi[j]); /* psi <- psi + psi_inc or its decay (Eq. 3) */
        v[j] = spike ? V_REST : v[j] - leak(v[j]); /* the leak of the next step (Eq. 1) */
        train |= spike << h;
    }
    return (word)train;
}

void cell_reset(void)
{
    for (unsigned j = 0; j < N_NEURONS; j++) {
        v[j] = psi[j] = 0;
        theta[AS_PRINTED ? j : 0] = THETA_0;
    }
    age = 0;
}

#else /* a perceptron with tanh everywhere, on the inputs too */

#define encode(sensor, reading, first) (reading)
#define decode(value) (value)

/* exp(x) - 1 = 2^k (exp(r) - 1) + (2^k - 1), where x = k ln 2 + r, |r| <= ln 2 / 2, and
 * exp(r) - 1 = r + r^2 (1/2! + r/3! + r^2/4! + ...). LN2_HIGH + LN2_LOW = ln 2, k LN2_HIGH is
 * exact, and the sum with ROUND has k in its low bits. The series has N_TERMS terms. */
static number exp_minus_1(number x)
{
    static const number inverse_factorials[] = INVERSE_FACTORIALS;
    number shifted = x * LOG2_E + ROUND, k = shifted - ROUND;
    number r = (x - k * LN2_HIGH) - k * LN2_LOW, series = inverse_factorials[N_TERMS];
    union { number value; bits bits; } power = {shifted};
    for (unsigned n = N_TERMS - 1; n >= 2; n--)
        series = series * r + inverse_factorials[n];
    power.bits = (power.bits << MANTISSA) + ((bits)EXPONENT_BIAS << MANTISSA); /* 2^k */
    return power.value * (series * r * r + r) + (power.value - 1);
}

/* Return y = tanh(bias + sum of w_i x_i) of neuron j; tanh(z) = e / (e + 2), e = exp(2 z) - 1. */
static word run_neuron(unsigned j, unsigned l, const weight *w, const word *pre, unsigned n)
{
    number total = constants[j], magnitude, e;
    (void)l;
    for (unsigned i = 0; i < n; i++)
        total += w[i] * pre[i];
    magnitude = total < 0 ? -total : total; /* above TANH_IS_1, tanh rounds to 1 */
    e = exp_minus_1(2 * (magnitude > TANH_IS_1 ? TANH_IS_1 : magnitude));
    return total < 0 ? -(e / (e + 2)) : e / (e + 2);
}

void cell_reset(void)
{
}

#endif

void cell_step(uint32_t step, const struct inputs *in, struct outputs *out)
{
    static const weight one = 1;
    const weight *w = weights;
    const word *pre = words;
    unsigned j = 0;
    (void)step; /* which only spikes depend on */
    for (; j < N_SENSORS; j++)
        words[j] = encode(j, in->readings[j], step * SNN_STEPS);
    for (; j < sizes[0]; j++)
        words[j] = in->received[j - N_SENSORS];
    for (j = 0; j < sizes[0]; j++) /* an input neuron has one synapse, of weight 1 */
        words[j] = run_neuron(j, 0, &one, &words[j], 1);
    for (unsigned l = 1; l < N_LAYERS; pre += sizes[l - 1], l++)
        for (unsigned n = 0; n < sizes[l]; n++, j++, w += sizes[l - 1])
            words[j] = run_neuron(j, l, w, pre, sizes[l - 1]);
    out->actuation = decode(words[OUTPUT]);
    for (unsigned c = 0; c < N_SENT; c++)
        out->sent[c] = words[OUTPUT + 1 + c];
}
