// A stub, not Unity: the few declarations of UnityEngine on which runtime/unity relies, compared with Unity's published C# source, so
// that a compiler sees that the Unity layer is well-formed. Nothing here does anything.

using System;
using UnityEngine.Rendering;

namespace Unity.Collections
{
    public enum Allocator { Persistent }

    public struct NativeArray<T> : IDisposable where T : struct
    {
        public NativeArray(int length, Allocator allocator) { }
        public int Length => 0;
        public bool IsCreated => false;
        public void Dispose() { }
    }
}

namespace Unity.Collections.LowLevel.Unsafe
{
    public static unsafe class NativeArrayUnsafeUtility
    {
        public static void* GetUnsafePtr<T>(NativeArray<T> nativeArray) where T : struct => null;
    }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
    public enum VertexAttribute { Position, Normal, TexCoord0 }
    public enum VertexAttributeFormat { Float32 }

    [Flags]
    public enum MeshUpdateFlags { Default = 0, DontValidateIndices = 1, DontResetBoneBounds = 2, DontNotifyMeshUsers = 4, DontRecalculateBounds = 8 }

    public struct VertexAttributeDescriptor
    {
        public VertexAttributeDescriptor(VertexAttribute attribute = VertexAttribute.Position, VertexAttributeFormat format = VertexAttributeFormat.Float32, int dimension = 3, int stream = 0) { }
    }

    public struct SubMeshDescriptor
    {
        public SubMeshDescriptor(int indexStart, int indexCount, MeshTopology topology = MeshTopology.Triangles) { }
    }
}

namespace UnityEngine
{
    public enum MeshTopology { Triangles }

    // These two share names with ours.
    public struct Pose { }
    public class Motion : Object { }

    public struct Vector2 { public float x, y; }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero => new Vector3();
        public static Vector3 one => new Vector3(1, 1, 1);
        public static Vector3 operator +(Vector3 a, Vector3 b) => a;
        public static Vector3 operator *(Vector3 a, float d) => a;
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity => new Quaternion(0, 0, 0, 1);
        public static Quaternion Inverse(Quaternion rotation) => rotation;
        public static Quaternion operator *(Quaternion lhs, Quaternion rhs) => lhs;
    }

    public struct Bounds
    {
        public Bounds(Vector3 center, Vector3 size) { }
    }

    public static class Mathf
    {
        public static float Sin(float f) => 0;
        public static float Cos(float f) => 0;
    }

    public static class Time
    {
        public static float deltaTime => 0;
        public static float time => 0;
    }

    public static class Debug { public static void Log(object message) { } }
    public static class Application { public static string streamingAssetsPath => ""; }

    public class Object
    {
        public string name { get; set; }
        public static void Destroy(Object obj) { }
        public static bool operator ==(Object x, Object y) => ReferenceEquals(x, y);
        public static bool operator !=(Object x, Object y) => !ReferenceEquals(x, y);
        public override bool Equals(object other) => ReferenceEquals(this, other);
        public override int GetHashCode() => 0;
    }

    public class TextAsset : Object { public byte[] bytes => null; }
    public class Material : Object { public Texture mainTexture { get; set; } }
    public class Texture : Object { }
    public class Texture2D : Texture { public Texture2D(int width, int height) { } }
    public static class ImageConversion { public static bool LoadImage(this Texture2D tex, byte[] data) => false; }

    public class Mesh : Object
    {
        public int subMeshCount { get; set; }
        public Bounds bounds { get; set; }
        public void MarkDynamic() { }
        public void SetVertexBufferParams(int vertexCount, params VertexAttributeDescriptor[] attributes) { }
        public void SetVertexBufferData<T>(Unity.Collections.NativeArray<T> data, int dataStart, int meshBufferStart, int count, int stream = 0, MeshUpdateFlags flags = MeshUpdateFlags.Default) where T : struct { }
        public void SetIndexBufferParams(int indexCount, IndexFormat format) { }
        public void SetIndexBufferData<T>(T[] data, int dataStart, int meshBufferStart, int count, MeshUpdateFlags flags = MeshUpdateFlags.Default) where T : struct { }
        public void SetSubMesh(int index, SubMeshDescriptor desc, MeshUpdateFlags flags = MeshUpdateFlags.Default) { }
        public void RecalculateNormals(MeshUpdateFlags flags) { }
    }

    public class Component : Object
    {
        public Transform transform => null;
        public T GetComponent<T>() => default(T);
    }

    public class Behaviour : Component { }
    public class MonoBehaviour : Behaviour { }

    public class Transform : Component
    {
        public Vector3 position { get; set; }
        public Quaternion rotation { get; set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; }
        public Vector3 localScale { get; set; }
        public void SetParent(Transform parent, bool worldPositionStays) { }
        public Vector3 InverseTransformPoint(Vector3 position) => position;
        public Vector3 TransformPoint(Vector3 position) => position;
    }

    public class GameObject : Object
    {
        public GameObject(string name) { }
        public Transform transform => null;
        public T AddComponent<T>() where T : Component => null;
        public T GetComponent<T>() => default(T);
    }

    public class Renderer : Component
    {
        public Material material { get; set; }
        public Material sharedMaterial { get; set; }
    }

    public class MeshRenderer : Renderer { }
    public class MeshFilter : Component { public Mesh sharedMesh { get; set; } }

    public class Animator : Behaviour
    {
        public bool isHuman => false;
        public Transform GetBoneTransform(HumanBodyBones humanBoneId) => null;
    }

    public enum HumanBodyBones { Hips }

    [AttributeUsage(AttributeTargets.Field)] public class SerializeField : Attribute { }
    [AttributeUsage(AttributeTargets.Field)] public class HeaderAttribute : Attribute { public HeaderAttribute(string header) { } }
    [AttributeUsage(AttributeTargets.Field)] public class TooltipAttribute : Attribute { public TooltipAttribute(string tooltip) { } }
    public class AddComponentMenu : Attribute { public AddComponentMenu(string menuName) { } }
    public class RequireComponent : Attribute { public RequireComponent(Type requiredComponent, Type requiredComponent2) { } }
    public class DefaultExecutionOrder : Attribute { public DefaultExecutionOrder(int order) { } }
}
