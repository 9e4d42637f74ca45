/** Chooses where the colour of the new cloth comes from. */
import { hasColours } from '../model/gltf_document.js';
import { TEXTURES, UNDECIDED, type Texture } from '../model/textures.js';
import { type TemplateResult, css, html, nothing } from '../vendor.js';
import { Panel } from './panel.js';

/** The event `darn-look` shows the new cloth in its colour: tinted, a choice would change nothing that is seen. */
export class TextureChoice extends Panel {
  static override styles = [
    Panel.styles,
    css`
      :host {
        display: block;
        margin-top: 6px;
      }
      label {
        display: block;
      }
      select:disabled {
        color: var(--quiet);
        opacity: 0.65;
      }
      p {
        margin: 4px 0 0;
      }
    `,
  ].flat();

  protected override render(): TemplateResult {
    const { canVary, texture, scan } = this.editor;
    const colours = scan !== undefined && hasColours(scan.document);
    const options = [[undefined, UNDECIDED], ...TEXTURES] as const;
    return html`
      <label>
        Colour of the new cloth
        <select ?disabled=${!canVary || !colours} @change=${this.choose}>
          ${options.map(
            ([choice, name]) => html` <option value=${choice ?? ''} .selected=${choice === texture}>${name}</option> `,
          )}
        </select>
      </label>
      ${
        colours
          ? nothing
          : html`<p class="quiet small">
              This scan has neither images nor colours of vertices: the new cloth has its material.
            </p>`
      }
    `;
  }

  private readonly choose = (event: Event): void => {
    const { value } = event.target as HTMLSelectElement;
    this.dispatchEvent(new CustomEvent('darn-look', { detail: { tinted: false }, bubbles: true, composed: true }));
    void this.editor.vary({ texture: value === '' ? undefined : (value as Texture) });
  };
}

customElements.define('darn-texture', TextureChoice);
