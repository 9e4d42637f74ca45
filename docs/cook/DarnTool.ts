// The tool: source/server/tools/DarnTool.ts of a Smithsonian Cook (dpo-cook). Its entry in tools.json has the name `Darn`.

import Tool, { IToolMessageEvent, IToolSettings, IToolSetup, ToolInstance } from "../app/Tool";

export interface IDarnToolSettings extends IToolSettings
{
    /** The scan: GLB, glTF, OBJ, PLY or a zip, by its content. */
    inputMeshFile: string;
    /** The mended scan, in the format of the scan. */
    outputMeshFile: string;
    /** Where the report goes, as JSON. */
    reportFile: string;
}

export type DarnInstance = ToolInstance<DarnTool, IDarnToolSettings>;

export default class DarnTool extends Tool<DarnTool, IDarnToolSettings>
{
    static readonly toolName = "Darn";

    protected static readonly defaultSettings: Partial<IDarnToolSettings> = { };

    async setupInstance(instance: DarnInstance): Promise<IToolSetup>
    {
        const settings = instance.settings;
        const executable = this.configuration.executable;
        const inputFile = instance.getFilePath(settings.inputMeshFile);
        const outputFile = instance.getFilePath(settings.outputMeshFile);
        const reportFile = instance.getFilePath(settings.reportFile);
        if (!inputFile || !outputFile || !reportFile) {
            throw new Error("DarnTool needs inputMeshFile, outputMeshFile and reportFile");
        }

        const command =
            `"${executable}" inpaint "${inputFile}" -o "${outputFile}" --report "${reportFile}" --json-lines --if-no-holes copy --deadline 600s`;
        return { command };
    }

    /** Keeps the code and the text of a failure; stages and the end of a mend are for the log. */
    onInstanceMessage(event: IToolMessageEvent): boolean
    {
        const { instance, message } = event;
        if (!message.startsWith("{")) {
            return false;
        }
        try {
            const line = JSON.parse(message);
            if (line.type === "report" && line.status === "failed") {
                const execution = instance.report.execution;
                execution.results = { ...execution.results, error: `${line.code}: ${line.detail}` };
            }
        }
        catch {
            // A long line may come in pieces: the report is read from its file.
        }
        return false;
    }
}
