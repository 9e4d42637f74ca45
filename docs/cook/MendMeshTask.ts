// The task: source/server/tasks/MendMeshTask.ts of a Smithsonian Cook (dpo-cook). Recipes know it as `MendMesh`.

import * as fs from "fs-extra";

import Job from "../app/Job";
import Task, { ITaskParameters } from "../app/Task";
import ToolTask from "../app/ToolTask";
import { IDarnToolSettings } from "../tools/DarnTool";

export interface IMendMeshTaskParameters extends ITaskParameters
{
    /** The scan. */
    inputMeshFile: string;
    /** The mended scan, in the format of the scan. */
    outputMeshFile: string;
    /** The report of the mend, as JSON. There is none where the scan had no holes. */
    reportFile: string;
    /** Most seconds (default: that of the tool's entry). */
    timeout?: number;
}

export default class MendMeshTask extends ToolTask
{
    static readonly taskName = "MendMesh";

    static readonly description = "Fills the holes of scanned cloth.";

    static readonly parameterSchema = {
        type: "object",
        properties: {
            inputMeshFile: { type: "string", minLength: 1 },
            outputMeshFile: { type: "string", minLength: 1 },
            reportFile: { type: "string", minLength: 1 },
            timeout: { type: "integer", minimum: 0, default: 0 }
        },
        required: [ "inputMeshFile", "outputMeshFile", "reportFile" ],
        additionalProperties: false
    };

    static readonly parameterValidator = Task.jsonValidator.compile(MendMeshTask.parameterSchema);

    constructor(params: IMendMeshTaskParameters, context: Job)
    {
        super(params, context);

        const settings: IDarnToolSettings = {
            inputMeshFile: params.inputMeshFile,
            outputMeshFile: params.outputMeshFile,
            reportFile: params.reportFile,
            timeout: params.timeout
        };
        this.addTool("Darn", settings);
    }

    protected async execute(): Promise<unknown>
    {
        await super.execute();
        const reportFile = this.getFilePath((this.parameters as IMendMeshTaskParameters).reportFile);
        if (await fs.pathExists(reportFile)) {
            const report = await fs.readJson(reportFile);
            this.result.mended = report.holes.length;
            this.result.skipped = report.skipped.length;
        }
        else {
            // The scan had no holes and was copied. A recipe delivers the file in any case.
            await fs.writeJson(reportFile, { holes: [], skipped: [] });
            this.result.mended = 0;
        }
        return undefined;
    }
}
