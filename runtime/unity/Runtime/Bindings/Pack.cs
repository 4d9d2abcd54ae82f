// Packs: what is in them, and what a renderer needs once.

using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Kitsuke
{
    /// <summary>Texts of a kimono.</summary>
    public enum Text
    {
        /// <summary>The catalog's name.</summary>
        Id,
        /// <summary>The name people read.</summary>
        Name,
        /// <summary>The body on which it was made.</summary>
        Body,
        /// <summary>The texture's file name.</summary>
        Texture,
        /// <summary>The name of a part.</summary>
        Part,
        /// <summary>The name of a target.</summary>
        Target,
        /// <summary>The name of a measured path.</summary>
        Path,
        /// <summary>Its kanji.</summary>
        PathJa,
    }

    /// <summary>Counts of a kimono.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct PackInformation
    {
        internal uint StructSize;
        private uint vertexCount, uniqueCount, triangleCount, partCount, targetCount, correctiveCount, hasUv, hasSizes;
        private uint obiVertexCount, obiTriangleCount, pathCount, textureWidth, textureHeight, textureBytes, jointCount;

        /// <summary>Vertices of a frame, seam twins included.</summary>
        public int VertexCount => (int)vertexCount;
        /// <summary>Of them those that are no seam twins; they come first.</summary>
        public int UniqueCount => (int)uniqueCount;
        public int TriangleCount => (int)triangleCount;
        /// <summary>Named pieces of cloth, in triangle order.</summary>
        public int PartCount => (int)partCount;
        /// <summary>Target shapes.</summary>
        public int TargetCount => (int)targetCount;
        /// <summary>How many of the last targets belong to no pose.</summary>
        public int CorrectiveCount => (int)correctiveCount;
        /// <summary>Whether every vertex has texture coordinates.</summary>
        public bool HasUv => hasUv != 0;
        /// <summary>Whether it can be fitted to wearers.</summary>
        public bool HasSizes => hasSizes != 0;
        /// <summary>0 without an obi.</summary>
        public int ObiVertexCount => (int)obiVertexCount;
        public int ObiTriangleCount => (int)obiTriangleCount;
        /// <summary>Measured paths.</summary>
        public int PathCount => (int)pathCount;
        /// <summary>Pixels; 0 without a texture.</summary>
        public int TextureWidth => (int)textureWidth;
        public int TextureHeight => (int)textureHeight;
        /// <summary>Of the texture's PNG; 0 where the pack only names it.</summary>
        public int TextureBytes => (int)textureBytes;
        /// <summary>Joints of the skeleton.</summary>
        public int JointCount => (int)jointCount;
    }

    /// <summary>Where a bone's joint rests in the T-pose, and the bone that carries it (null: none does).</summary>
    public struct Joint
    {
        public Place Place;
        public Bone? Parent;
    }

    /// <summary>A kimono: from a pack, or fitted to a wearer. It is only read: threads may share it.</summary>
    public sealed unsafe class Pack : Handle
    {
        public PackInformation Information { get; }

        internal Pack(IntPtr opened)
        {
            SetHandle(opened);
            var info = new PackInformation { StructSize = (uint)sizeof(PackInformation) };
            Call.Check(Native.kitsuke_pack_info(this, &info));
            Information = info;
        }

        /// <summary>Opens a pack. The bytes are not needed afterwards; they may be a stranger's.</summary>
        public static Pack Open(ReadOnlySpan<byte> bytes)
        {
            Call.CheckAbi();
            fixed (byte* first = &MemoryMarshal.GetReference(bytes))
            {
                Call.Check(Native.kitsuke_pack_open(first, (UIntPtr)(uint)bytes.Length, out var opened));
                return new Pack(opened);
            }
        }

        protected override bool ReleaseHandle()
        {
            Native.kitsuke_pack_free(handle);
            return true;
        }

        public string Name => Text(Kitsuke.Text.Name);

        /// <summary>A text; the index counts parts, targets or paths and is passed over elsewhere.</summary>
        public string Text(Text text, int index = 0)
        {
            UIntPtr length;
            Call.Check(Native.kitsuke_pack_text(this, text, (uint)index, null, UIntPtr.Zero, &length));
            var bytes = new byte[(int)length + 1];
            fixed (byte* buffer = bytes)
                Call.Check(Native.kitsuke_pack_text(this, text, (uint)index, buffer, (UIntPtr)(uint)bytes.Length, &length));
            return Encoding.UTF8.GetString(bytes, 0, (int)length);
        }

        /// <summary>The corners of the triangles, wound as these axes want.</summary>
        public uint[] Indices(Axes axes)
        {
            var indices = new uint[(int)Native.kitsuke_pack_index_count(this)];
            Indices(axes, indices);
            return indices;
        }

        public void Indices(Axes axes, Span<uint> indices)
        {
            fixed (uint* first = &MemoryMarshal.GetReference(indices))
                Call.Check(Native.kitsuke_pack_indices(this, axes, first, (UIntPtr)(uint)indices.Length));
        }

        /// <summary>The same for the obi.</summary>
        public uint[] ObiIndices(Axes axes)
        {
            var indices = new uint[3 * Information.ObiTriangleCount];
            ObiIndices(axes, indices);
            return indices;
        }

        public void ObiIndices(Axes axes, Span<uint> indices)
        {
            fixed (uint* first = &MemoryMarshal.GetReference(indices))
                Call.Check(Native.kitsuke_pack_obi_indices(this, axes, first, (UIntPtr)(uint)indices.Length));
        }

        /// <summary>Writes the texture coordinates into vertices, each from this offset in bytes: v from the top in glTF and Unreal,
        /// from the bottom in Unity. Writes nothing where there are none.</summary>
        public void Uv<V>(Axes axes, Span<V> vertices, int offset) where V : struct
        {
            var bytes = MemoryMarshal.AsBytes(vertices);
            fixed (byte* first = &MemoryMarshal.GetReference(bytes))
                Call.Check(Native.kitsuke_pack_uv(this, axes, new Attribute(first, bytes.Length, offset, Vertices.Size(vertices))));
        }

        /// <summary>The same close together, two floats each.</summary>
        public float[] Uv(Axes axes)
        {
            var uv = new float[Information.HasUv ? 2 * Information.VertexCount : 0];
            fixed (float* first = uv)
                if (Information.HasUv) Call.Check(Native.kitsuke_pack_uv(this, axes, new Attribute((byte*)first, 4 * uv.Length)));
            return uv;
        }

        /// <summary>The texture as PNG; empty where the pack only names it or there is none.</summary>
        public byte[] Texture()
        {
            var png = new byte[Information.TextureBytes];
            fixed (byte* first = png)
                if (png.Length > 0) Call.Check(Native.kitsuke_pack_texture(this, first, (UIntPtr)(uint)png.Length));
            return png;
        }

        /// <summary>The length of a measured path in the T-pose, metres.</summary>
        public float PathLengthM(int index)
        {
            float lengthM;
            Call.Check(Native.kitsuke_pack_path_length(this, (uint)index, &lengthM));
            return lengthM;
        }

        /// <summary>A bone's joint; null where the kimono's skeleton lacks the bone.</summary>
        public Joint? Joint(Axes axes, Bone bone)
        {
            Bones.Check(bone);
            Place place;
            int parent;
            var status = Native.kitsuke_pack_joint(this, axes, (uint)bone, (float*)&place, &parent);
            if (status == Status.Range) return null;
            Call.Check(status);
            return new Joint { Place = place, Parent = parent < 0 ? (Bone?)null : (Bone)parent };
        }

        /// <summary>The pose of a target that belongs to one: all but the correctives.</summary>
        public Pose TargetPose(Axes axes, int target)
        {
            Pose pose;
            Call.Check(Native.kitsuke_pack_target_pose(this, axes, (uint)target, &pose));
            return pose;
        }

        /// <summary>The pose as the kimono allows it: show the wearer in this pose, too. Does not allocate.</summary>
        public Pose Limited(Axes axes, Pose pose, out float turnedRad)
        {
            float turned;
            Call.Check(Native.kitsuke_limit(this, axes, &pose, &pose, &turned));
            turnedRad = turned;
            return pose;
        }
    }
}
