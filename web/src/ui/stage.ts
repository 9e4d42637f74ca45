/** The picture of the scan as an element: it shows the editor's state, and gives pointers and keys to the gestures. */
import { moveByKey } from '../scene/camera_keys.js';
import { marksOf } from '../scene/draft_marks.js';
import { Gestures } from '../scene/gestures.js';
import type { Heat, HeatScale } from '../scene/heat_colors.js';
import { Viewer } from '../scene/viewer.js';
import { type TemplateResult, css, html } from '../vendor.js';
import { heatLegend, legendStyles } from './heat_legend.js';
import { Panel } from './panel.js';

/** Milliseconds in which the service answers a draft, as a rule. */
const ANSWER = 60;

export class Stage extends Panel {
  static override styles = [
    Panel.styles,
    legendStyles,
    css`
      :host {
        display: block;
        position: relative;
        overflow: hidden;
        background: radial-gradient(circle at 50% 40%, var(--surface), var(--raised));
      }
      #host {
        position: absolute;
        inset: 0;
      }
      canvas {
        display: block;
        touch-action: none;
      }
      canvas:focus-visible {
        outline-offset: -3px;
      }
    `,
  ].flat();

  viewer: Viewer | undefined;
  private gestures: Gestures | undefined;
  /** The heat map that is drawn, and its scale once it is known. */
  private heat: Heat | undefined;
  private scale: HeatScale | undefined;
  private readonly opened = (): void => void this.show();

  override connectedCallback(): void {
    super.connectedCallback();
    this.editor.addEventListener('opened', this.opened);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.editor.removeEventListener('opened', this.opened);
    this.gestures?.dispose();
    this.viewer?.dispose();
    this.viewer = undefined;
  }

  protected override render(): TemplateResult {
    return html`<div id="host"></div>
      ${heatLegend(this.heat, this.scale)}`;
  }

  protected override firstUpdated(): void {
    const host = this.renderRoot.querySelector<HTMLElement>('#host');
    if (host === null) {
      return;
    }
    try {
      this.viewer = new Viewer(host);
      this.gestures = new Gestures(this.viewer, this.editor);
      this.gestures.onMarks = () => this.requestUpdate();
    } catch (error) {
      this.editor.report(new Error(`This browser draws no 3-D pictures (WebGL 2): ${String(error)}`));
      return;
    }
    this.viewer.onError = (error) => this.editor.report(error);
    this.viewer.onHeat = (heat, scale) => {
      this.heat = heat;
      this.scale = scale;
      this.requestUpdate();
    };
    const { canvas } = this.viewer;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute(
      'aria-label',
      'The scan. Drag or arrow keys to turn it; two fingers, the right button or Shift and arrow keys to move it; the wheel, plus or minus to zoom; F to see all.',
    );
    canvas.addEventListener('keydown', (event) => {
      if (this.viewer !== undefined && moveByKey(this.viewer.controls, event)) {
        event.preventDefault();
      }
    });
    canvas.addEventListener('dblclick', (event) => {
      const hit = this.viewer?.pick(event.clientX, event.clientY);
      if (hit !== undefined) {
        this.viewer?.pivotAt(hit.position);
      }
    });
  }

  protected override updated(): void {
    this.viewer?.chooseLoops(this.editor.chosen);
    void this.viewer?.showPatches(this.editor.patches);
    this.viewer?.showCut(this.editor.step.cutFaces);
    this.viewer?.mark(
      marksOf(this.editor, {
        cloth: this.gestures?.waitingPoint,
        border: this.gestures?.waitingEnd,
        disk: this.gestures?.disk,
        lines: (draft) => this.viewer?.borderLines(draft) ?? { stretches: [], hems: [] },
      }),
      this.editor.isAsking ? ANSWER : 0,
    );
  }

  private async show(): Promise<void> {
    const { scan } = this.editor;
    if (scan !== undefined) {
      try {
        await this.viewer?.showScan(scan.bytes, scan.loops);
        this.requestUpdate();
      } catch (error) {
        this.editor.report(new Error(`The scan was read by the service, but cannot be drawn: ${String(error)}`));
      }
    }
  }
}

customElements.define('darn-stage', Stage);
