/** Defines the custom element of the editor, for the service's own page and for others. */
import './ui/editor_element.js';
