// What a C# program does with kitsuke, and what it must not get away with. Prints what it sees; the suite `doors_csharp` compares.

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using Kitsuke;

static class Client
{
    struct Vector { public float X, Y, Z; }
    struct Vertex { public Vector Position, Normal; public float U, V; }
    struct Short { public float X, Y; }

    static int Main(string[] arguments)
    {
        var folder = arguments[0];
        Func<string, byte[]> read = name => File.ReadAllBytes(Path.Combine(folder, name));
        var bytes = read("garment.kitsuke");
        var pack = Pack.Open(bytes);
        var info = pack.Information;
        var n = info.VertexCount;
        Console.WriteLine($"{pack.Name} ({pack.Text(Text.Id)}) on {pack.Text(Text.Body)}: {n} vertices, {info.UniqueCount} of them unique, {info.TriangleCount} triangles, {info.PartCount} parts, {info.TargetCount} targets, {info.CorrectiveCount} of them correctives, {info.JointCount} joints");
        Console.WriteLine($"obi of {info.ObiVertexCount} and {info.ObiTriangleCount}, {info.PathCount} paths, texture {pack.Text(Text.Texture)} {info.TextureWidth} x {info.TextureHeight} in {info.TextureBytes} bytes, texture coordinates: {info.HasUv}, sizes: {info.HasSizes}");
        Console.WriteLine($"parts {string.Join(", ", Enumerable.Range(0, info.PartCount).Select(i => pack.Text(Text.Part, i)))}; path {pack.Text(Text.Path, 0)} {pack.Text(Text.PathJa, 0)}: {pack.PathLengthM(0):F4} m; PNG: {pack.Texture()[1] == 'P'}");

        // Bones by number and name.
        for (var bone = Bone.Hips; (int)bone < Bones.Count; bone++)
        {
            var vrm = Bones.Name(bone);
            if (!Bones.TryFind(vrm, out var found) || found != bone || char.ToUpper(vrm[0]) + vrm.Substring(1) != bone.ToString())
                Console.WriteLine($"{bone} IS {vrm}");
        }
        Console.WriteLine($"noBone: {Bones.TryFind("noBone", out _)}");
        var arm = pack.Joint(Axes.Gltf, Bone.LeftUpperArm).Value;
        var mirrored = pack.Joint(Axes.Unity, Bone.LeftUpperArm).Value;
        Console.WriteLine($"left upper arm on {arm.Parent}, mirrored in Unity: {arm.Place.X == -mirrored.Place.X && arm.Place.Y == mirrored.Place.Y}; jaw: {(pack.Joint(Axes.Gltf, Bone.Jaw) == null ? "none" : "THERE")}");

        // Frames, as they go to a GPU: positions, then normals, each in a buffer of its own.
        var poses = MemoryMarshal.Cast<byte, Pose>(read("poses.f32")).ToArray();
        var evaluator = new Evaluator(pack, Axes.Gltf);
        var positions = new Vector[n];
        var normals = new Vector[n];
        using (var frames = File.Create(Path.Combine(folder, "frames.f32")))
            foreach (var pose in poses)
            {
                evaluator.Evaluate<Vector>(pose, positions, normals);
                Write(frames, positions);
                Write(frames, normals);
            }

        // The same interleaved, with texture coordinates.
        var vertices = new Vertex[n];
        evaluator.Evaluate<Vector>(poses[0], positions, normals);
        pack.Uv<Vertex>(Axes.Gltf, vertices, 24);
        evaluator.EvaluateInterleaved<Vertex>(poses[0], vertices, 0, 12);
        var uv = pack.Uv(Axes.Gltf);
        var floats = new float[3 * n];
        evaluator.Evaluate<float>(poses[0], floats);
        Console.WriteLine($"interleaved: {Enumerable.Range(0, n).Count(v => !(Same(vertices[v].Position, positions[v]) && Same(vertices[v].Normal, normals[v]) && vertices[v].U == uv[2 * v] && vertices[v].V == uv[2 * v + 1]))} differ, without normals {Enumerable.Range(0, n).Count(v => floats[3 * v] != positions[v].X)}");

        // In Unity's axes poses go in and places come out mirrored, and the outside stays outside.
        var there = new Vector[n];
        var thereNormals = new Vector[n];
        var inUnity = new Evaluator(pack, Axes.Unity);
        inUnity.Evaluate<Vector>(ForUnity(poses[0]), there, thereNormals);
        var (corners, cornersThere) = (pack.Indices(Axes.Gltf), pack.Indices(Axes.Unity));
        var turned = Enumerable.Range(0, info.TriangleCount).All(t => corners[3 * t] == cornersThere[3 * t] && corners[3 * t + 1] == cornersThere[3 * t + 2] && corners[3 * t + 2] == cornersThere[3 * t + 1]);
        Console.WriteLine($"Unity: {Enumerable.Range(0, n).Count(v => !(Same(Mirrored(there[v]), positions[v]) && Same(Mirrored(thereNormals[v]), normals[v])))} differ, triangles turned over: {turned}, v from the bottom: {Math.Abs(pack.Uv(Axes.Unity)[1] + uv[1] - 1) < 1e-6}");

        // The obi; what the kimono allows.
        var obi = new Vector[info.ObiVertexCount];
        var obiThere = new Vector[info.ObiVertexCount];
        evaluator.EvaluateObi<Vector>(poses[0], obi);
        var (obiNormals, obiNormalsThere) = (new Vector[obi.Length], new Vector[obi.Length]);
        inUnity.EvaluateObi<Vector>(ForUnity(poses[0]), obiThere, obiNormalsThere);
        evaluator.EvaluateObi<Vector>(poses[0], obi, obiNormals);
        Console.WriteLine($"normals of the obi: {Enumerable.Range(0, obi.Length).Count(v => !Same(Mirrored(obiNormalsThere[v]), obiNormals[v]))} differ; head hangs on {Bones.Parent(Bone.Head)}, hips on {Bones.Parent(Bone.Hips)?.ToString() ?? "nothing"}");
        Console.WriteLine($"obi: {Enumerable.Range(0, obi.Length).Count(v => !Same(Mirrored(obiThere[v]), obi[v]))} differ, {pack.ObiIndices(Axes.Unity).Max()} is the last vertex of {obi.Length}");
        pack.Limited(Axes.Gltf, poses[0], out var turnedRad);
        Console.WriteLine($"limited: turned back: {turnedRad > 0}; target 0 turns {Enumerable.Range(0, Bones.Count).Count(b => Math.Abs(pack.TargetPose(Axes.Gltf, 0)[(Bone)b].W) < 0.999)} bone");

        // A rig whose bones stand anyhow in the T-pose gives the pose that it was put in.
        Console.WriteLine($"rig: {RigError(pack, poses.Take(20)):F4} rad");

        // A recorded motion.
        var motion = new Motion(read("motion.bvh"), pack);
        var confidence = new float[Bones.Count];
        var first = motion.PoseOf(0, Axes.Gltf, confidence);
        evaluator.Evaluate<Vector>(motion.PoseAt(motion.LengthS / 2, Axes.Gltf), positions, normals);
        Console.WriteLine($"motion: {motion.FrameCount} frames, {motion.LengthS:F2} s, confidence {confidence.Max()}, {motion.Notes().Length} notes, starts as at 0 s: {first.Equals(motion.PoseAt(0, Axes.Gltf))}");

        // A live one, whose first pose has two bones.
        var receiver = new Receiver(pack);
        var completed = receiver.Datagram(Vmc("Hips", "LeftUpperArm"), 1.0) + receiver.Datagram(new byte[] { 1, 2, 3 }, 1.5);
        completed += receiver.Datagram(Vmc("Hips", "LeftUpperArm"), 2.0);
        receiver.Pose(2.25, 1, Axes.Gltf, out var ageS, confidence);
        Console.WriteLine($"live: {completed} poses, {ageS:F2} s old, confidence of the left arm {confidence[(int)Bone.LeftUpperArm]:F1}");

        // A fit, and the fitted kimono posed.
        var fitter = new Fitter(pack);
        var wearer = new Measurements { ["body_height"] = 1.62f, ["bust_girth"] = 0.9f, ["hip_girth"] = 0.95f };
        var fit = fitter.Fit(wearer, 0, out var fitted);
        Console.WriteLine($"fit by {fitter.RuleSetName(0)}: {fit.Verdict}, {fit.Explanation}, as without a kimono: {fitter.Fit(wearer).MovedM == fit.MovedM}; {wearer.Count()} measurements");
        for (var i = 0; i < fitter.DimensionCount; i++)
            Console.WriteLine($"    {fitter.DimensionName(i)}: {fitter.Reach(i).WantedM:F3} wanted, {fitter.Reach(i).ReachedM:F3} reached, within {fitter.Reach(i).LowestM:F3} to {fitter.Reach(i).HighestM:F3} m");
        var worn = new Evaluator(fitted, Axes.Gltf);
        fitted.Dispose();
        worn.Evaluate<Vector>(poses[1], positions, normals);

        // What must be refused.
        Refused("half a pack", () => Pack.Open(new ReadOnlySpan<byte>(bytes, 0, bytes.Length / 2)));
        Refused("no bytes", () => Pack.Open(default(ReadOnlySpan<byte>)));
        Refused("no pack", () => new Evaluator(null, Axes.Gltf));
        Refused("axes that there are not", () => new Evaluator(pack, (Axes)7));
        Refused("target that there is not", () => pack.Text(Text.Target, 99));
        Refused("part before the first", () => pack.Text(Text.Part, -1));
        Refused("bone that there is not", () => { var pose = new Pose(); pose[(Bone)55] = Rotation.Identity; });
        Refused("short buffer of indices", () => pack.Indices(Axes.Gltf, new uint[corners.Length - 1]));
        Refused("buffer short by a vector", () => evaluator.Evaluate<Vector>(poses[0], new Vector[n - 1]));
        Refused("normals short by a vector", () => evaluator.Evaluate<Vector>(poses[0], positions, new Vector[n - 1]));
        Refused("no buffer", () => evaluator.Evaluate<Vector>(poses[0], null));
        Refused("vertices too small for a vector", () => evaluator.EvaluateInterleaved<Short>(poses[0], new Short[2 * n], 0, 0));
        Refused("normals beyond the last vertex", () => evaluator.EvaluateInterleaved<Vertex>(poses[0], vertices, 0, 24));
        Refused("offset before the first", () => evaluator.EvaluateInterleaved<Vertex>(poses[0], vertices, -4, 12));
        Refused("frame beyond the end", () => motion.PoseOf(motion.FrameCount, Axes.Gltf));
        Refused("confidence of too few bones", () => motion.PoseOf(0, Axes.Gltf, new float[3]));
        Refused("a motion that is none", () => new Motion(new byte[] { 1, 2, 3 }, pack));
        Refused("T-pose before a pose", () => new Receiver(pack).Calibrate());
        Refused("rule set that there is not", () => fitter.Fit(wearer, 9));
        Refused("measurement that there is not", () => wearer["height"] = 1.62f);
        worn.Dispose();
        worn.Dispose();
        Refused("evaluator that was disposed of", () => worn.Evaluate<Vector>(poses[0], positions));

        // Four threads, one pack.
        var sums = new double[4];
        var threads = sums.Select((_, t) => new Thread(() => sums[t] = Sum(pack, poses))).ToArray();
        foreach (var thread in threads) thread.Start();
        foreach (var thread in threads) thread.Join();
        Console.WriteLine($"threads: {(sums.All(sum => sum == sums[0]) && sums[0] != 0 ? "the same" : "DIFFERENT")}");

        // Frames leave no garbage, whatever is done in them.
        var rig = new Rig(pack, Axes.Unity);
        foreach (var bone in rig.Bones) rig.SetRest(bone, Rotation.Identity);
        var now = Enumerable.Repeat(Rotation.Identity, Bones.Count).ToArray();
        long before = 0;
        for (var i = 0; i < 10100; i++)
        {
            if (i == 100) before = GC.GetAllocatedBytesForCurrentThread();
            evaluator.Evaluate<Vector>(poses[i % poses.Length], positions, normals);
            inUnity.EvaluateInterleaved<Vertex>(pack.Limited(Axes.Unity, motion.PoseAt(0.001 * i, Axes.Unity), out _), vertices, 0, 12);
            inUnity.EvaluateObi<Vector>(rig.Pose(now, rig.HipsRest), obi);
            rig.Stand(poses[0], now);
        }
        Console.WriteLine($"bytes allocated by 10,000 frames: {GC.GetAllocatedBytesForCurrentThread() - before}");
        var kept = new byte[1000];
        Console.WriteLine($"and the counter counts: {GC.GetAllocatedBytesForCurrentThread() - before >= kept.Length}");

        pack.Dispose();
        evaluator.Evaluate<Vector>(poses[0], positions);
        Console.WriteLine("an evaluator outlives its pack");
        return 0;
    }

    static void Write(Stream to, Vector[] vectors)
    {
        var bytes = MemoryMarshal.AsBytes<Vector>(vectors).ToArray();
        to.Write(bytes, 0, bytes.Length);
    }

    static bool Same(Vector a, Vector b) => a.X == b.X && a.Y == b.Y && a.Z == b.Z;
    static Vector Mirrored(Vector v) => new Vector { X = -v.X, Y = v.Y, Z = v.Z };

    static Pose ForUnity(Pose pose)
    {
        for (var bone = Bone.Hips; (int)bone < Bones.Count; bone++)
        {
            var q = pose[bone];
            pose[bone] = new Rotation(q.X, -q.Y, -q.Z, q.W);
        }
        pose.HipsTranslation.X = -pose.HipsTranslation.X;
        return pose;
    }

    /// The farthest that a bone's rotation is from the pose in which a model with any axes was put.
    static double RigError(Pack pack, IEnumerable<Pose> poses)
    {
        var rig = new Rig(pack, Axes.Gltf);
        var now = new Rotation[Bones.Count];
        var angle = 0.0f;
        foreach (var bone in rig.Bones)
        {
            angle += 0.7f;
            rig.SetRest(bone, new Rotation((float)Math.Sin(angle), 0, 0, (float)Math.Cos(angle)) * new Rotation(0, (float)Math.Sin(angle), 0, (float)Math.Cos(angle)));
        }
        var farthest = 0.0;
        foreach (var pose in poses)
        {
            var back = rig.Pose(now, rig.Stand(pose, now));
            foreach (var bone in rig.Bones)
            {
                var between = pose[bone].Inverse * back[bone];
                var sine = Math.Sqrt(between.X * between.X + between.Y * between.Y + between.Z * between.Z);
                farthest = Math.Max(farthest, 2 * Math.Asin(Math.Min(1, sine)));
            }
            farthest = Math.Max(farthest, Math.Abs(back.HipsTranslation.X - pose.HipsTranslation.X));
        }
        return farthest;
    }

    static double Sum(Pack pack, Pose[] poses)
    {
        using (var own = new Evaluator(pack, Axes.Gltf))
        {
            var floats = new float[3 * pack.Information.VertexCount];
            var sum = 0.0;
            foreach (var pose in poses)
            {
                own.Evaluate<float>(pose, floats);
                foreach (var number in floats) sum += number;
            }
            return sum;
        }
    }

    /// A VMC bundle with these bones and the sender's time, which ends a pose.
    static byte[] Vmc(params string[] bones)
    {
        var messages = bones.Select(bone => Message("/VMC/Ext/Bone/Pos", Padded(bone), 0, 0, 0, 0, 0, 0, 1)).ToList();
        messages.Add(Message("/VMC/Ext/T", new byte[0], 1));
        var sized = messages.SelectMany(message => BigEndian(BitConverter.GetBytes(message.Length)).Concat(message));
        return Padded("#bundle").Concat(new byte[] { 0, 0, 0, 0, 0, 0, 0, 1 }).Concat(sized).ToArray();
    }

    static byte[] Message(string address, byte[] name, params float[] numbers)
    {
        var types = (name.Length > 0 ? ",s" : ",") + new string('f', numbers.Length);
        var values = numbers.SelectMany(number => BigEndian(BitConverter.GetBytes(number)));
        return Padded(address).Concat(Padded(types)).Concat(name).Concat(values).ToArray();
    }

    static byte[] Padded(string text) => Encoding.ASCII.GetBytes(text.PadRight(text.Length / 4 * 4 + 4, '\0'));
    static IEnumerable<byte> BigEndian(byte[] number) => number.Reverse();

    /// With what status and message.
    static void Refused(string what, Action call)
    {
        try
        {
            call();
            Console.WriteLine($"{what}: NOT REFUSED");
        }
        catch (KitsukeException refusal)
        {
            Console.WriteLine($"{what}: {refusal.Status}, {refusal.Message}");
        }
        catch (Exception refusal) when (refusal is ArgumentException || refusal is ObjectDisposedException || refusal is KeyNotFoundException)
        {
            Console.WriteLine($"{what}: {refusal.GetType().Name}");
        }
    }
}
