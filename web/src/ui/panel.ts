/** What the parts of the page have in common: each shows the one editor, and is drawn again when that has changed. */
import type { Editor } from '../model/editor.js';
import { LitElement, css } from '../vendor.js';
import { shared } from './styles.js';

/** An element that shows the editor's state. Its owner sets `editor` before it is connected. */
export abstract class Panel extends LitElement {
  static override styles = [
    shared,
    css`
      fieldset {
        margin: 0 0 0.5rem;
        padding: 0;
        border: 0;
      }
      .choice {
        display: flex;
        align-items: center;
        gap: 4px;
        min-height: 28px;
      }
    `,
  ];

  editor!: Editor;
  private readonly changed = (): void => this.requestUpdate();

  override connectedCallback(): void {
    super.connectedCallback();
    this.editor.addEventListener('change', this.changed);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.editor.removeEventListener('change', this.changed);
  }
}
