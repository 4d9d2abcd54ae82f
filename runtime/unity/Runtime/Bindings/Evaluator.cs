// Frames: the kimono in a pose, written straight into the caller's memory. Nothing here allocates.

using System;
using System.Runtime.InteropServices;

namespace Kitsuke
{
    /// <summary>A kimono with the working memory of one thread: make one per thread. All its frames are in the same axes.</summary>
    public sealed unsafe class Evaluator : Handle
    {
        public Evaluator(Pack pack, Axes axes)
        {
            Call.Check(Native.kitsuke_evaluator_new(pack, axes, out handle));
        }

        protected override bool ReleaseHandle()
        {
            Native.kitsuke_evaluator_free(handle);
            return true;
        }

        /// <summary>Writes positions and unit normals close together: floats, or vectors of three of them of any type. Without normals
        /// it is a quarter faster.</summary>
        public void Evaluate<V>(Pose pose, Span<V> positions, Span<V> normals = default(Span<V>)) where V : struct
        {
            var positionBytes = MemoryMarshal.AsBytes(positions);
            var normalBytes = MemoryMarshal.AsBytes(normals);
            fixed (byte* firstPosition = &MemoryMarshal.GetReference(positionBytes))
            fixed (byte* firstNormal = &MemoryMarshal.GetReference(normalBytes))
            {
                var toPositions = new Attribute(firstPosition, positionBytes.Length);
                var toNormals = new Attribute(firstNormal, normalBytes.Length);
                Call.Check(Native.kitsuke_evaluate(this, &pose, &toPositions, normals.IsEmpty ? null : &toNormals));
            }
        }

        /// <summary>Writes into vertices of several attributes, each from its offset in bytes; what else is in them stays.</summary>
        public void EvaluateInterleaved<V>(Pose pose, Span<V> vertices, int positionOffset, int normalOffset) where V : struct
        {
            var bytes = MemoryMarshal.AsBytes(vertices);
            fixed (byte* first = &MemoryMarshal.GetReference(bytes))
            {
                var toPositions = new Attribute(first, bytes.Length, positionOffset, Vertices.Size(vertices));
                var toNormals = new Attribute(first, bytes.Length, normalOffset, Vertices.Size(vertices));
                Call.Check(Native.kitsuke_evaluate(this, &pose, &toPositions, &toNormals));
            }
        }

        /// <summary>Writes the positions and, unless there is no room, the normals of the obi in this pose, which must be that of the
        /// kimono. Writes nothing where there is no obi.</summary>
        public void EvaluateObi<V>(Pose pose, Span<V> positions, Span<V> normals = default(Span<V>)) where V : struct
        {
            var positionBytes = MemoryMarshal.AsBytes(positions);
            var normalBytes = MemoryMarshal.AsBytes(normals);
            fixed (byte* firstPosition = &MemoryMarshal.GetReference(positionBytes), firstNormal = &MemoryMarshal.GetReference(normalBytes))
            {
                var toPositions = new Attribute(firstPosition, positionBytes.Length);
                var toNormals = new Attribute(firstNormal, normalBytes.Length);
                Call.Check(Native.kitsuke_evaluate_obi(this, &pose, &toPositions, normals.IsEmpty ? null : &toNormals));
            }
        }
    }

    internal static class Vertices
    {
        /// Bytes from one to the next.
        internal static int Size<V>(Span<V> vertices) where V : struct =>
            vertices.IsEmpty ? 0 : MemoryMarshal.AsBytes(vertices).Length / vertices.Length;
    }
}
