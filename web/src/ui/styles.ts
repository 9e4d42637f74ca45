/** Colours, spacing and controls that all elements share. */
import { css } from '../vendor.js';

export const shared = css`
  :host {
    --surface: #ffffff;
    --raised: #f4f5f7;
    --text: #1c2026;
    --quiet: #555e6b;
    --line: #c9ced6;
    --accent: #1b5fa8;
    --on-accent: #ffffff;
    --error: #a61b1b;
    --error-surface: #fdecea;
    color: var(--text);
    font:
      14px/1.45 system-ui,
      -apple-system,
      'Segoe UI',
      sans-serif;
  }
  @media (prefers-color-scheme: dark) {
    :host {
      --surface: #1b1f25;
      --raised: #262c35;
      --text: #eceff4;
      --quiet: #b0b8c4;
      --line: #454e5b;
      --accent: #8dbdf2;
      --on-accent: #10233a;
      --error: #ffb4ab;
      --error-surface: #4a1f1c;
    }
  }
  [hidden] {
    display: none !important;
  }
  h2,
  h3 {
    margin: 0 0 0.5rem;
    font-size: 1rem;
  }
  h3 {
    font-size: 0.875rem;
  }
  p {
    margin: 0 0 0.5rem;
  }
  button,
  input,
  select,
  textarea {
    box-sizing: border-box;
    min-height: 28px;
    border: 1px solid var(--line);
    border-radius: 5px;
    background: var(--surface);
    color: inherit;
    font: inherit;
  }
  button {
    padding: 2px 10px;
    cursor: pointer;
  }
  button:hover:enabled {
    border-color: var(--accent);
  }
  button:disabled {
    color: var(--quiet);
    cursor: default;
    opacity: 0.65;
  }
  button.main,
  button[aria-pressed='true'] {
    border-color: var(--accent);
    background: var(--accent);
    color: var(--on-accent);
  }
  input[type='checkbox'],
  input[type='radio'] {
    width: 24px;
    min-height: 24px;
    margin: 0;
    accent-color: var(--accent);
  }
  input[type='range'] {
    width: 100%;
    accent-color: var(--accent);
  }
  input[type='number'] {
    width: 100%;
    padding: 2px 6px;
  }
  textarea {
    width: 100%;
    font:
      12px/1.4 ui-monospace,
      monospace;
  }
  :focus-visible {
    outline: 2px solid var(--accent);
    outline-offset: 2px;
  }
  summary {
    box-sizing: border-box;
    min-height: 28px;
    padding: 4px 0;
    cursor: pointer;
  }
  .row {
    display: flex;
    flex-wrap: wrap;
    gap: 6px;
    align-items: center;
  }
  .quiet {
    color: var(--quiet);
  }
  .small {
    font-size: 12px;
  }
`;
