/** What the colours of a heat map mean. */
import { short } from '../model/loops.js';
import { type Heat, type HeatScale, OWN_STYLE, UNKNOWN_STYLE, heatGradient } from '../scene/heat_colors.js';
import { type TemplateResult, css, html, nothing, unsafeCSS } from '../vendor.js';

export const legendStyles = css`
  .legend {
    position: absolute;
    top: 12px;
    left: 12px;
    width: 21rem;
    max-width: calc(100% - 24px);
    box-sizing: border-box;
    padding: 8px 10px;
    border: 1px solid var(--line);
    border-radius: 6px;
    background: var(--surface);
    font-size: 12px;
    pointer-events: none;
  }
  .legend p {
    margin: 4px 0 0;
  }
  .bar {
    height: 14px;
    margin-top: 4px;
    border: 1px solid var(--line);
    border-radius: 3px;
    background: ${unsafeCSS(heatGradient('curvature'))};
  }
  .bar.confidence {
    background: ${unsafeCSS(heatGradient('confidence'))};
  }
  .ends {
    display: flex;
    justify-content: space-between;
    gap: 8px;
  }
  .ends span:nth-child(2) {
    text-align: center;
  }
  .ends span:last-child {
    text-align: right;
  }
  .patch {
    display: inline-block;
    width: 12px;
    height: 12px;
    border-radius: 3px;
    vertical-align: -1px;
    background: ${unsafeCSS(UNKNOWN_STYLE)};
  }
  .patch.own {
    background: ${unsafeCSS(OWN_STYLE)};
  }
`;

interface Words {
  readonly title: string;
  readonly about: string;
  /** What grey means. */
  readonly unknown: string;
  /** The colours from the least value to the largest, for a screen reader. */
  readonly bar: string;
  /** What a map of the new cloth alone says of the scan's own. */
  readonly own?: string;
  readonly unit?: string;
  /** The least, perhaps a middle, and the largest value. */
  ends(most: number): readonly string[];
}

const TWO_SIDED_BAR = 'From blue over white to orange';

const WORDS: Readonly<Record<Heat, Words>> = {
  stretch: {
    title: 'Stretch',
    about: 'Lengths of the cloth, compared with the same cloth laid flat.',
    unknown: 'Grey: not laid flat: away from the mended holes.',
    bar: TWO_SIDED_BAR,
    ends: (most) => {
      const percent = `${short(most * 100)} %`;
      const shorter = Number(((1 - 1 / (1 + most)) * 100).toPrecision(2));
      return [`${shorter} % shorter`, 'as flat', `${percent} longer`];
    },
  },
  curvature: {
    title: 'Curvature',
    about: 'Whether the cloth bends in two directions at once. Cloth that is only folded stays white.',
    unknown: 'Grey: not known.',
    bar: TWO_SIDED_BAR,
    unit: "In one over the scan's unit squared.",
    ends: (most) => [`saddle, −${short(most)}`, 'flat or folded, 0', `dome, ${short(most)}`],
  },
  confidence: {
    title: 'Confidence',
    about:
      'How far new cloth may be off: nine of ten vertices lie within 1.6 times this of the cloth that was there. That is of the cloth before anchors and gestures.',
    unknown: 'Dark grey: new cloth of which it is not known.',
    bar: 'From light yellow over orange to dark brown',
    own: "Light grey: the scan's own cloth.",
    unit: "In the scan's unit.",
    ends: (most) => ['certain, 0', `uncertain, ${short(most)}`],
  },
};

const NOTHING_KNOWN =
  'Nothing is known: no hole is mended yet, or none that is has a chart and was filled with weights that were calibrated.';

/** The legend; without a scale the map is still computed. */
export function heatLegend(heat: Heat | undefined, scale: HeatScale | undefined): TemplateResult | typeof nothing {
  if (heat === undefined) {
    return nothing;
  }
  const { title, about, unknown, bar, own, unit, ends } = WORDS[heat];
  if (scale === undefined) {
    return html`<div class="legend" role="status"><strong>${title}</strong> is computed …</div>`;
  }
  const isUnknown = Number.isNaN(scale.most);
  return html`
    <div class="legend" role="group" aria-label="Legend: ${title}">
      <strong>${title}</strong>
      ${
        isUnknown
          ? html`<p>${NOTHING_KNOWN}</p>`
          : html`<div class="bar ${heat}" role="img" aria-label=${bar}></div>
              <div class="ends">${ends(scale.most).map((end) => html`<span>${end}</span>`)}</div>
              <p>${about}</p>`
      }
      <p><span class="patch"></span> ${unknown}</p>
      ${own === undefined ? nothing : html`<p><span class="patch own"></span> ${own}</p>`}
      ${unit === undefined || isUnknown ? nothing : html`<p class="quiet">${unit}</p>`}
    </div>
  `;
}
