// SPDX-License-Identifier: GPL-3.0-or-later
// A job type for Flamenco 3: the parts of a job that `--command arto plan` wrote, then the one task
// that joins them. Put it beside Flamenco Manager in `scripts`.

const JOB_TYPE = {
    label: "ARTO Capture",
    description: "Render the parts of an ARTO job and gather them into reflectance fields",
    settings: [
        {
            key: "job_folder", type: "string", subtype: "dir_path", required: true,
            description: "The folder that 'arto plan' wrote, as workers see it",
        },
        {
            key: "parts", type: "int32", required: true, default: 1,
            description: "How many parts the job has: 'parts' in its job.json",
        },
        {
            key: "addon", type: "string", required: true, default: "bl_ext.user_default.arto",
            description: "The extension's module on the workers",
        },
        {
            key: "blendfile", type: "string", required: true, visible: "web",
            eval: "bpy.data.filepath", description: "The .blend that was planned",
        },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (settings.parts < 1) {
        throw new Error("an ARTO job has at least one part: see 'parts' in its job.json");
    }
    const gather = task(settings, "gather", ["gather"]);
    for (let part = 0; part < settings.parts; part++) {
        const one = task(settings, `part-${part}`, ["part", `${part}`]);
        gather.addDependency(one);
        job.addTask(one);
    }
    job.addTask(gather);
}

function task(settings, name, verb) {
    const out = author.Task(name, "blender");
    out.addCommand(author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: ["--factory-startup", "--offline-mode", "--addons", settings.addon],
        blendfile: settings.blendfile,
        args: ["--command", "arto"].concat(verb, ["--job", settings.job_folder]),
    }));
    return out;
}
