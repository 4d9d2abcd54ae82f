// The meshes of a kimono and its obi: filled from packs once, and with a pose every frame, without garbage.

using System;
using Unity.Collections;
using Unity.Collections.LowLevel.Unsafe;
using UnityEngine;
using UnityEngine.Rendering;

namespace Kitsuke.Unity
{
    internal sealed unsafe class GarmentMesh : IDisposable
    {
        // One stream as a GPU reads it: position, normal, texture coordinates.
        private struct Vertex
        {
            internal Vector3 Position, Normal;
            internal Vector2 Uv;
        }

        private const int PositionOffset = 0, NormalOffset = 12, UvOffset = 24;

        // Bounds are set by hand and indices never change.
        private const MeshUpdateFlags AsItIs = MeshUpdateFlags.DontRecalculateBounds | MeshUpdateFlags.DontValidateIndices;

        // A posed kimono lies within this of its hips.
        private const float ReachM = 2.5f;

        private readonly Evaluator evaluator;
        private readonly Vector3 hipsRest;
        private NativeArray<Vertex> vertices;
        private NativeArray<Vector3> obiPositions, obiNormals;

        internal Mesh Kimono { get; }
        /// Null without one.
        internal Mesh Obi { get; }

        internal GarmentMesh(Pack pack)
        {
            evaluator = new Evaluator(pack, Axes.Unity);
            var hips = new Rig(pack, Axes.Unity).HipsRest;
            hipsRest = new Vector3(hips.X, hips.Y, hips.Z);
            var information = pack.Information;

            vertices = new NativeArray<Vertex>(information.VertexCount, Allocator.Persistent);
            if (information.HasUv) pack.Uv(Axes.Unity, All(vertices), UvOffset);
            Kimono = Made(pack.Name, information.VertexCount, pack.Indices(Axes.Unity),
                new VertexAttributeDescriptor(VertexAttribute.Position, VertexAttributeFormat.Float32, 3, 0),
                new VertexAttributeDescriptor(VertexAttribute.Normal, VertexAttributeFormat.Float32, 3, 0),
                new VertexAttributeDescriptor(VertexAttribute.TexCoord0, VertexAttributeFormat.Float32, 2, 0));

            obiPositions = new NativeArray<Vector3>(information.ObiVertexCount, Allocator.Persistent);
            obiNormals = new NativeArray<Vector3>(information.ObiVertexCount, Allocator.Persistent);
            if (information.ObiVertexCount > 0)
                Obi = Made(pack.Name + " obi", information.ObiVertexCount, pack.ObiIndices(Axes.Unity),
                    new VertexAttributeDescriptor(VertexAttribute.Position, VertexAttributeFormat.Float32, 3, 0),
                    new VertexAttributeDescriptor(VertexAttribute.Normal, VertexAttributeFormat.Float32, 3, 1));
            Show(new Pose());
        }

        internal void Show(Pose pose)
        {
            var way = pose.HipsTranslation;
            var bounds = new Bounds(hipsRest + new Vector3(way.X, way.Y, way.Z), Vector3.one * (2 * ReachM));

            evaluator.EvaluateInterleaved(pose, All(vertices), PositionOffset, NormalOffset);
            Kimono.SetVertexBufferData(vertices, 0, 0, vertices.Length, 0, AsItIs);
            Kimono.bounds = bounds;

            if (Obi == null) return;
            evaluator.EvaluateObi(pose, All(obiPositions), All(obiNormals));
            Obi.SetVertexBufferData(obiPositions, 0, 0, obiPositions.Length, 0, AsItIs);
            Obi.SetVertexBufferData(obiNormals, 0, 0, obiNormals.Length, 1, AsItIs);
            Obi.bounds = bounds;
        }

        public void Dispose()
        {
            evaluator.Dispose();
            if (vertices.IsCreated) vertices.Dispose();
            if (obiPositions.IsCreated) obiPositions.Dispose();
            if (obiNormals.IsCreated) obiNormals.Dispose();
            UnityEngine.Object.Destroy(Kimono);
            if (Obi != null) UnityEngine.Object.Destroy(Obi);
        }

        private static Mesh Made(string name, int vertexCount, uint[] indices, params VertexAttributeDescriptor[] attributes)
        {
            var mesh = new Mesh { name = name };
            mesh.MarkDynamic();
            mesh.SetVertexBufferParams(vertexCount, attributes);
            mesh.SetIndexBufferParams(indices.Length, IndexFormat.UInt32);
            mesh.SetIndexBufferData(indices, 0, 0, indices.Length, AsItIs);
            mesh.subMeshCount = 1;
            mesh.SetSubMesh(0, new SubMeshDescriptor(0, indices.Length, MeshTopology.Triangles), AsItIs);
            return mesh;
        }

        private static Span<T> All<T>(NativeArray<T> array) where T : struct =>
            new Span<T>(NativeArrayUnsafeUtility.GetUnsafePtr(array), array.Length);
    }
}
