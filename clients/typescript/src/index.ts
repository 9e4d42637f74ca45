/** A client of darn's HTTP service for browsers and Node: uploads with progress, sessions that are dragged, jobs, typed problems. */
export type * from './contract.js';
export { type DragEvents, type HolePositions, ClothSession } from './cloth_session.js';
export { type Following, type JobLabels, type JobQuery, type Waiting, Jobs, isFinished } from './jobs.js';
export { Latest } from './latest.js';
export { type Part, partsOf } from './multipart.js';
export { type FieldFault, ProblemError, describeError, isAbort, problemOf } from './problem.js';
export { type Answer, type Progress } from './requests.js';
export { type MapEvents, type MendedPatches, type MendedPositions, Service } from './service.js';
export type { ServiceOptions } from './transport.js';
