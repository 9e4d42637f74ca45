/** What the colours of a heat map mean. */
import { short } from '../model/loops.js';
import { type Heat, type HeatScale, heatGradient, unknownColor } from '../scene/heat_colors.js';
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
    background: ${unsafeCSS(heatGradient())};
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
    background: ${unsafeCSS(unknownColor())};
  }
`;

interface Words {
  readonly title: string;
  readonly about: string;
  readonly unknown: string;
  /** The least, the middle and the largest value. */
  ends(most: number): [string, string, string];
}

const WORDS: Readonly<Record<Heat, Words>> = {
  stretch: {
    title: 'Stretch',
    about: 'Lengths of the cloth, compared with the same cloth laid flat.',
    unknown: 'not laid flat: away from the mended holes',
    ends: (most) => {
      const percent = `${short(most * 100)} %`;
      const shorter = Number(((1 - 1 / (1 + most)) * 100).toPrecision(2));
      return [`${shorter} % shorter`, 'as flat', `${percent} longer`];
    },
  },
  curvature: {
    title: 'Curvature',
    about: 'Whether the cloth bends in two directions at once. Cloth that is only folded stays white.',
    unknown: 'not known',
    ends: (most) => [`saddle, −${short(most)}`, 'flat or folded, 0', `dome, ${short(most)}`],
  },
};

/** The legend; without a scale the map is still computed. */
export function heatLegend(heat: Heat | undefined, scale: HeatScale | undefined): TemplateResult | typeof nothing {
  if (heat === undefined) {
    return nothing;
  }
  const { title, about, unknown, ends } = WORDS[heat];
  if (scale === undefined) {
    return html`<div class="legend" role="status"><strong>${title}</strong> is computed …</div>`;
  }
  const [least, middle, most] = ends(scale.most);
  return html`
    <div class="legend" role="group" aria-label="Legend: ${title}">
      <strong>${title}</strong>
      <div class="bar" role="img" aria-label="From blue over white to orange"></div>
      <div class="ends"><span>${least}</span><span>${middle}</span><span>${most}</span></div>
      <p>${about}</p>
      <p><span class="patch"></span> Grey: ${unknown}.</p>
      ${heat === 'curvature' ? html`<p class="quiet">In one over the scan's unit squared.</p>` : nothing}
    </div>
  `;
}
