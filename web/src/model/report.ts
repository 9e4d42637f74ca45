/** The service's report in words. */
import type { Confidence, HoleReport, Report, Skipped } from '../client.js';
import type { Step } from './editor_state.js';
import { fillInWords, fillName } from './fills.js';
import { short } from './loops.js';
import { colourInWords, textureInWords, textureName } from './textures.js';

const NO_CHART = 'The cloth around it cannot be laid flat: a fair surface without folds, which takes no gestures.';

/** Nine of ten vertices lie within so many standard deviations of the cloth that was there. */
const WITHIN_90 = 1.645;

/** Codes of loops that are left because of what was chosen. */
const CHOICES = new Set(['not_selected', 'excepted', 'outer_boundary', 'tube_end', 'opening']);

/** The loops that were to be filled and are left open. */
export function leftOpen(skipped: readonly Skipped[]): Skipped[] {
  return skipped.filter(({ code = '' }) => !CHOICES.has(code));
}

/** Why a loop is left open. */
export function reasonInWords({ id, reason = '' }: Skipped): string {
  return `Left open: ${withControls(reason.replace(`hole ${id}: `, ''))}.`;
}

/** The control that accepts doubtful cloth. */
export const ACCEPT_DOUBTFUL = 'Mend with doubtful cloth, too';

/** A text of the service with the page's control in place of the member of a request. */
export function withControls(text: string): string {
  return text.replaceAll('`acceptDoubtful`', `“${ACCEPT_DOUBTFUL}”`);
}

/** One sentence or two for each hole. */
export function holeInWords(hole: HoleReport): string[] {
  const patch = hole.patch ?? {};
  const faces = (patch.faces ?? 0).toLocaleString('en');
  const alternative = patch.alternative ?? 0;
  const lines = [
    `Hole ${hole.id}: ${faces} new triangles, area ${short(patch.area)}, on a rim of length ${short(hole.length)}.`,
    `${stretchInWords(patch.stretchMean, patch.stretchMax)} ${crossingsInWords(patch.selfIntersections ?? 0)}`,
    patch.method === 'fair' ? NO_CHART : shareInWords(patch.networkShare),
    alternative > 0 ? fillInWords(alternative) : '',
    hole.texture === undefined ? '' : colourInWords(hole.texture),
    confidenceInWords(patch.confidence, (hole.anchors ?? []).length + (hole.edits ?? []).length),
  ];
  if (hole.cut !== undefined && (hole.cut.faces ?? 0) > 0) {
    const cut = (hole.cut.faces ?? 0).toLocaleString('en');
    lines.push(`${cut} triangles of the scan were cut out first, area ${short(hole.cut.area)}.`);
  }
  for (const anchor of hole.anchors ?? []) {
    const beyond = anchor.beyondReach ?? 0;
    const reach = beyond > 0 ? `; ${short(beyond)} of that is beyond the cloth's reach` : '';
    lines.push(`An anchor is ${short(anchor.distance)} away from the cloth${reach}.`);
  }
  for (const edit of hole.edits ?? []) {
    lines.push(`A gesture is followed to within ${short(edit.distance)}.`);
  }
  return [...lines, ...(hole.doubts ?? []).map((doubt) => `Doubtful: ${doubt}.`), ...(hole.notes ?? [])].filter(
    (line) => line !== '',
  );
}

/** The whole report in one sentence. */
export function reportInWords(report: Report): string {
  const filled = report.holes?.length ?? 0;
  const skipped = report.skipped?.length ?? 0;
  const left = skipped === 1 ? '1 loop is' : `${skipped} loops are`;
  return `${count(filled, 'hole')} filled; ${left} left open.`;
}

/** What a step did, in a sentence or two. */
export function stepInWords({ label, constraints, patches, report }: Step): string {
  if (label === fillName(constraints.alternative)) {
    return fillInWords(constraints.alternative, report);
  }
  if (label === textureName(constraints.texture)) {
    return textureInWords(constraints.texture, report);
  }
  const faces = patches.reduce((sum, patch) => sum + (patch.hole.patchFaces?.length ?? 0) / 3, 0);
  const open = leftOpen(report?.skipped ?? []).length;
  const doubtful = (report?.holes ?? []).filter(({ doubts = [] }) => doubts.length > 0).length;
  return [
    `${label}: ${patches.length} filled, ${faces.toLocaleString('en')} new triangles.`,
    ...(open > 0 ? [`${count(open, 'hole')} left open; the list says why.`] : []),
    ...(doubtful > 0 ? [`${doubtful} with doubtful cloth.`] : []),
  ].join(' ');
}

function stretchInWords(mean: number | undefined, most: number | undefined): string {
  if (mean === undefined || most === undefined) {
    return '';
  }
  return `Lengths differ from those of flat cloth by ${percent(mean - 1)} on average, ${percent(most - 1)} at most.`;
}

function crossingsInWords(crossings: number): string {
  return crossings === 0 ? 'No triangles cross.' : `${count(crossings, 'pair')} of triangles cross.`;
}

function shareInWords(share: number | undefined): string {
  if (share === undefined) {
    return '';
  }
  if (share >= 0.995) {
    return 'The network predicts its folds.';
  }
  return share <= 0.005
    ? 'A fair surface without folds, as the cloth around it has none.'
    : `${percent(share)} of the network's folds, for the rest a fair surface.`;
}

/** @param made - Anchors and gestures, which the confidence does not count. */
function confidenceInWords(confidence: Confidence | undefined, made: number): string {
  if (confidence?.median === undefined) {
    return '';
  }
  const grades: [string, number | undefined][] = [
    ['very high', confidence.veryHigh],
    ['high', confidence.high],
    ['medium', confidence.medium],
    ['low', confidence.low],
    ['very low', confidence.veryLow],
  ];
  const shares = grades
    .map(([grade, share = 0]) => [grade, Math.round(100 * share)] as const)
    .filter(([, share]) => share > 0)
    .map(([grade, share]) => `${grade} at ${share} %`);
  const before = made > 0 ? 'Before anchors and gestures, half' : 'Half';
  const within = short(WITHIN_90 * confidence.median);
  return `${before} of the new vertices have nine chances in ten to lie within ${within} of the cloth that was there; confidence is ${shares.join(', ')} of the vertices.`;
}

function percent(share: number): string {
  return `${Number((Math.abs(share) * 100).toPrecision(2))} %`;
}

function count(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}
