/** The client of the service that other pages use, too. */
export * from '../../clients/typescript/src/index.js';
