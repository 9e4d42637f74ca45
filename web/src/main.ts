/** Defines the custom elements of the editor's page. */
import './ui/editor_element.js';
