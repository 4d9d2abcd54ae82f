// Frames through the C# bindings, timed as in frame.c. Run by `cargo xtask bench`.
using System;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using System.Runtime.InteropServices;
using Kitsuke;

static class Frame
{
    const int Passes = 9;

    static double Median(double[] values)
    {
        Array.Sort(values);
        return values[(values.Length - 1) / 2];
    }

    static void Main(string[] arguments)
    {
        var poses = MemoryMarshal.Cast<byte, Pose>(File.ReadAllBytes(Path.Combine(arguments[0], "poses.f32")));
        using (var pack = Pack.Open(File.ReadAllBytes(Path.Combine(arguments[0], "garment.kitsuke"))))
        using (var evaluator = new Evaluator(pack, Axes.Gltf))
        {
            var positions = new Place[pack.Information.VertexCount];
            var normals = new Place[pack.Information.VertexCount];
            var times = new double[poses.Length][];
            for (var i = 0; i < poses.Length; i++) times[i] = new double[Passes];
            for (var pass = 0; pass < Passes; pass++)
                for (var i = 0; i < poses.Length; i++)
                {
                    var begin = Stopwatch.GetTimestamp();
                    evaluator.Evaluate<Place>(poses[i], positions, normals);
                    times[i][pass] = 1e6 * (Stopwatch.GetTimestamp() - begin) / Stopwatch.Frequency;
                }
            var medians = new double[poses.Length];
            for (var i = 0; i < poses.Length; i++) medians[i] = Median(times[i]);
            Console.WriteLine("frame_us " + Median(medians).ToString("F3", CultureInfo.InvariantCulture));
        }
    }
}
