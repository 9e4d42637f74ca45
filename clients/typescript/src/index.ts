/** A client of darn's HTTP service for browsers: uploads with progress, sessions that are dragged, typed problems. */
export type * from './contract.js';
export { type DragEvents, type HolePositions, ClothSession } from './cloth_session.js';
export { Latest } from './latest.js';
export { type Part, partsOf } from './multipart.js';
export { ProblemError, describeError, isAbort, problemOf } from './problem.js';
export { type Answer, type Progress } from './requests.js';
export { type MapEvents, type MendedPositions, type ServiceOptions, Service } from './service.js';
