"use strict";
// How right a count is. Some minutes are drawn in strata of similar traffic (vdet.traffic.sample), and checked. The true
// count is what was counted, plus the vehicles missed, minus those counted wrongly: known in checked minutes, estimated in
// the unchecked. Both kinds of errors are estimated by the combined ratio estimator of stratified sampling (Cochran,
// Sampling Techniques, 3rd ed., 1977, chapters 5 and 6), in proportion to the vehicles counted in a minute.
//
// Each kind has two intervals of 95 %, and the wider limits hold: one for errors that come independently, also where none
// was seen (Garwood 1936, for weighted sums as in Fay and Feuer, Statistics in Medicine 16, 1997), and one from the scatter
// between minutes (Student's t), for errors that come together. The interval of the difference follows from those of both
// kinds (Zou and Donner, Statistics in Medicine 27, 2008). Quantiles are approximated: chi-square by Wilson and Hilferty,
// t by Cornish and Fisher. benchmarks/estimates.py measures how often the intervals hold the truth.
const Z = 1.959964; // quantile of the normal distribution for 95 %, two-sided
const MIN_CHECKED = 3; // drawn minutes that an interval needs
// Errors added for the upper limit. With 1 (Garwood) it is too high: it holds 97.5 % at least. With 0.6, no error is seen in
// at most 6.5 % of the samples where the limit for none is too low.
const ADDED = 0.6;
const PRECISION = 0.02; // half of the width of an interval that is precise enough, as a fraction of the true count

/** Return a quantile of the gamma distribution; z is that of the normal distribution. */
function gammaQuantile(mean, variance, z) {
  if (variance === 0) return mean;
  const part = variance / (9 * mean * mean);
  return mean * Math.max(0, 1 - part + z * Math.sqrt(part)) ** 3;
}

/** Return the quantile of Student's t with n degrees of freedom for 95 %, two-sided. */
function studentQuantile(n) {
  const z = Z, second = (5 * z ** 5 + 16 * z ** 3 + 3 * z) / 96;
  return z + (z ** 3 + z) / 4 / n + second / n ** 2 + (3 * z ** 7 + 19 * z ** 5 + 17 * z ** 3 - 15 * z) / 384 / n ** 3;
}

/** Estimate the errors of one kind in unchecked minutes from their number in each minute. */
function uncheckedErrors({ errors, size, strata, sample, unchecked, limit }) {
  const sum = (minutes, value) => minutes.reduce((total, minute) => total + value(minute), 0);
  const inStratum = (minutes, minute) => minutes.filter(item => strata[item] === strata[minute]).length;
  const weights = new Map(sample.map(minute => [minute, 1 + inStratum(unchecked, minute) / inStratum(sample, minute)]));
  const traffic = sum(unchecked, minute => size[minute]), weighted = sum(sample, minute => weights.get(minute) * size[minute]);
  if (weighted === 0) return { number: 0, single: 0, scatter: 0, weight: limit, limit };
  const weight = minute => weights.get(minute) * traffic / weighted;
  const variance = minute => weight(minute) * (weight(minute) + 1);
  const number = sum(sample, minute => weight(minute) * errors[minute]);
  const residual = minute => traffic && errors[minute] - number / traffic * size[minute];
  return {
    number, limit,
    single: sum(sample, minute => variance(minute) * errors[minute]) * Math.max(0, 1 - number / (limit || 1)),
    scatter: sum(sample, minute => variance(minute) * residual(minute) ** 2) * sample.length / (sample.length - 1),
    weight: traffic / sum(sample, minute => size[minute]),
  };
}

/** Return the interval of errors in unchecked minutes: for the fraction of them still unchecked, of a sample of n. */
function errorBounds(errors, n, unchecked, spread) {
  const number = errors.number * unchecked, weight = errors.weight * spread;
  const single = errors.single * spread, scatter = errors.scatter * spread;
  const added = ADDED * weight, high = gammaQuantile(number + added, single + added * (weight + 1), Z);
  if (number === 0) return [0, Math.min(high, errors.limit)];
  const t = studentQuantile(n - 1);
  const low = Math.min(gammaQuantile(number, single, -Z), gammaQuantile(number, scatter, -t));
  return [Math.max(low, 0), Math.min(Math.max(high, gammaQuantile(number, scatter, t)), errors.limit)];
}

/** Return the parts of the interval below and above the estimate after more minutes. */
function intervalWidths(gains, losses, sample, left, more) {
  const n = sample + more, unchecked = 1 - more / left, spread = unchecked * sample / n;
  const [low, high] = errorBounds(gains, n, unchecked, spread);
  const [least, most] = errorBounds(losses, n, unchecked, spread);
  const gained = gains.number * unchecked, lost = losses.number * unchecked;
  return [Math.hypot(gained - low, most - lost), Math.hypot(high - gained, lost - least)];
}

/**
 * Estimate the true number of all vehicles (group null), then of each class.
 *
 * counted: { class: [vehicles in each minute] }; strata: the stratum of each minute; errors: [{ minute, counted, true }],
 * classes or null; checked, drawn: sets of minutes. Returns [{ group, counted, true, low, high, minutesToPrecision }], empty if minutes
 * are left and fewer than MIN_CHECKED of the drawn ones are checked.
 */
function estimateCounts({ counted, strata, errors, checked, drawn }) {
  const minutes = strata.map((_, minute) => minute), unchecked = minutes.filter(minute => !checked.has(minute));
  const sample = minutes.filter(minute => checked.has(minute) && drawn.has(minute));
  if (unchecked.length > 0 && sample.length < MIN_CHECKED) return [];
  const traffic = minutes.map(minute => Object.values(counted).reduce((sum, numbers) => sum + numbers[minute], 0));
  const classes = new Set([...Object.keys(counted), ...errors.map(error => error.true).filter(name => name !== null)]);
  return [null, ...[...classes].sort()].map(group => {
    const number = group === null ? traffic : counted[group] ?? minutes.map(() => 0);
    const isIn = name => name !== null && (group === null || group === name);
    const errorsIn = test => {
      const numbers = minutes.map(() => 0);
      errors.filter(test).forEach(error => numbers[error.minute]++);
      return numbers;
    };
    const added = errorsIn(error => isIn(error.true) && !isIn(error.counted));
    const removed = errorsIn(error => isIn(error.counted) && !isIn(error.true));
    const sum = numbers => numbers.reduce((total, number) => total + number, 0);
    const corrected = sum(number) + sum(added) - sum(removed), total = { group, counted: sum(number) };
    if (unchecked.length === 0) return { ...total, true: corrected, low: corrected, high: corrected, minutesToPrecision: 0 };
    const size = traffic.map(vehicles => vehicles + 1), limit = sum(unchecked.map(minute => number[minute]));
    const gains = uncheckedErrors({ errors: added, size, strata, sample, unchecked, limit: Infinity });
    const losses = uncheckedErrors({ errors: removed, size: number, strata, sample, unchecked, limit });
    const value = corrected + gains.number - losses.number;
    const [below, above] = intervalWidths(gains, losses, sample.length, unchecked.length, 0);
    let more = 0;
    while (more < unchecked.length && sum(intervalWidths(gains, losses, sample.length, unchecked.length, more)) > 2 * PRECISION * value) more++;
    return { ...total, true: value, low: value - below, high: value + above, minutesToPrecision: more };
  });
}
