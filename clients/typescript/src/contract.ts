/**
 * The service's messages, by the names of `proto/darn/v1/darn.proto`. The generated file is written by `scripts/web`
 * from `proto/openapi.json`. Every field may be absent, as in proto3's JSON.
 */
import type { components } from './contract.generated.js';

type Schemas = components['schemas'];

export type Anchor = Schemas['Anchor'];
export type AnchorFound = Schemas['AnchorFound'];
export type AnchorLine = Schemas['AnchorLine'];
export type AnchorQuery = Schemas['AnchorQuery'];
export type Border = Schemas['Border'];
export type BorderCandidate = Schemas['BorderCandidate'];
export type Confidence = Schemas['Confidence'];
export type Constraints = Schemas['Constraints'];
export type Cut = Schemas['Cut'];
export type Edit = Schemas['Edit'];
export type HoleSelector = Schemas['HoleSelector'];
export type HoleReport = Schemas['HoleReport'];
export type HolesReport = Schemas['HolesReport'];
export type Info = Schemas['Info'];
export type Job = Schemas['Job'];
export type JobList = Schemas['JobList'];
export type JobState = Schemas['JobState'];
export type JobWebhook = Schemas['JobWebhook'];
export type Loop = Schemas['Loop'];
export type MapPiece = Schemas['MapPiece'];
export type PatchSurface = Schemas['PatchSurface'];
export type Problem = Schemas['Problem'];
export type ProblemCode = Schemas['ProblemCode'];
export type Report = Schemas['Report'];
export type Session = Schemas['Session'];
export type SessionHole = Schemas['SessionHole'];
export type Skipped = Schemas['Skipped'];
export type TextureReport = Schemas['TextureReport'];
export type WebhookEvent = Schemas['WebhookEvent'];

/** A point or a direction in the scene's space. */
export type Vec3 = [number, number, number];
/** A point of a chart's unit square. */
export type Uv = [number, number];
