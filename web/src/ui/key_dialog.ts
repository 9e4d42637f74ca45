/** Asks a person for the key of a service, and keeps it as long as the tab is open. */
import { type TemplateResult, LitElement, css, html } from '../vendor.js';
import { shared } from './styles.js';

/** The key of a service in this tab: gone when the tab is closed, and never in an address. */
export class TabKeys {
  private readonly name: string;

  constructor(service: URL) {
    this.name = `darn key ${service.href}`;
  }

  get kept(): string | undefined {
    try {
      return sessionStorage.getItem(this.name) ?? undefined;
    } catch {
      // The page may not store anything.
      return undefined;
    }
  }

  keep(key: string | undefined): void {
    try {
      if (key === undefined) {
        sessionStorage.removeItem(this.name);
      } else {
        sessionStorage.setItem(this.name, key);
      }
    } catch {
      // It is asked for again at the next load.
    }
  }
}

/** `<darn-key>`: a dialog with one field. */
export class KeyDialog extends LitElement {
  static override styles = [
    shared,
    css`
      dialog {
        width: min(30rem, 90vw);
        border: 1px solid var(--line);
        border-radius: 6px;
        background: var(--surface);
        color: inherit;
      }
      h2 {
        margin-top: 0;
      }
      input {
        width: 100%;
        box-sizing: border-box;
        margin-bottom: 0.75rem;
      }
    `,
  ];

  private answer: ((key: string | undefined) => void) | undefined;

  /** Shows the dialog; the key, or `undefined` when the person has none. */
  ask(): Promise<string | undefined> {
    this.settle(undefined);
    this.field.value = '';
    this.dialog.showModal();
    return new Promise((resolve) => (this.answer = resolve));
  }

  protected override render(): TemplateResult {
    return html`
      <dialog aria-labelledby="title" @close=${() => this.settle(undefined)}>
        <form @submit=${this.submit}>
          <h2 id="title">This service takes a key</h2>
          <p>Whoever runs the service gives keys. It is kept until this tab is closed.</p>
          <input type="password" aria-label="Key" autocomplete="off" spellcheck="false" placeholder="darn_…" required />
          <div class="row">
            <button class="main" type="submit">Use this key</button>
            <button type="button" @click=${() => this.settle(undefined)}>Go on without</button>
          </div>
        </form>
      </dialog>
    `;
  }

  private get dialog(): HTMLDialogElement {
    return this.renderRoot.querySelector('dialog') as HTMLDialogElement;
  }

  private get field(): HTMLInputElement {
    return this.renderRoot.querySelector('input') as HTMLInputElement;
  }

  private readonly submit = (event: Event): void => {
    event.preventDefault();
    this.settle(this.field.value.trim());
  };

  private settle(key: string | undefined): void {
    const { answer } = this;
    this.answer = undefined;
    this.field.value = '';
    this.dialog.close();
    answer?.(key);
  }
}

customElements.define('darn-key', KeyDialog);
